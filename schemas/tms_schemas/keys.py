"""Logging in with an API key, and who one is."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from tms_schemas.base import Model


class LoginRequest(Model):
    key: Annotated[str, Field(min_length=1, max_length=200)]


class WhoAmI(Model):
    """``key`` is the id of the key in use; null on a loopback server that has no keys."""

    key: str | None
    name: str
    scopes: list[str]
