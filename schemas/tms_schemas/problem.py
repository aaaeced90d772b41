"""The error body (RFC 9457)."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class ProblemItem(BaseModel):
    """One offending part of the request: a JSON-pointer-like place, why, and the item's seq if it has one."""

    where: str
    why: str
    index: int | None = None
    seq: int | None = None


class Problem(BaseModel):
    """``application/problem+json``."""

    model_config = ConfigDict(extra="allow")

    type: str = "about:blank"
    title: str
    status: int
    detail: str = ""
    items: list[ProblemItem] = []
