"""Agents: who is alive, since when, how late."""

from __future__ import annotations

from typing import Literal

from tms_schemas.base import Model, UtcTime


class AgentView(Model):
    agent: str
    room: str | None
    #: The next sequence number an agent that lost its spool should use.
    next_seq: int
    first_seen: UtcTime | None
    last_seen: UtcTime | None
    last_observed_at: UtcTime | None
    #: last_seen - last_observed_at of the newest batch, seconds: how late its observations come.
    lag_s: float | None
    #: Sequence numbers below next_seq that never arrived.
    missing: int
    state: Literal["connected", "silent", "faulty", "unknown"]
    why: str = ""


class AgentPage(Model):
    items: list[AgentView]
    next_cursor: str | None = None
