"""What is told of an agent."""

from __future__ import annotations

from datetime import datetime
from typing import Literal, cast

from tms_schemas.agents import AgentView
from tms_server.db.tables import AgentRow
from tms_server.db.times import from_us

State = Literal["connected", "silent", "faulty", "unknown"]


def agent_view(row: AgentRow, *, now: datetime, silent_after_s: float, dispute: str = "") -> AgentView:
    """An agent that posts nothing for ``silent_after_s`` seconds is silent, whatever it said of itself.

    ``dispute``: its name is another one's, too; which of both said the rest nobody knows.
    """
    last_seen = from_us(row.last_seen)
    state, why = cast(State, row.state), row.why
    if (now - last_seen).total_seconds() > silent_after_s:
        state, why = "silent", f"nothing since {last_seen.isoformat(timespec='seconds')}"
    if dispute:
        state, why = "faulty", dispute
    return AgentView(
        agent=row.agent,
        room=row.room,
        next_seq=row.next_seq,
        first_seen=from_us(row.first_seen),
        last_seen=last_seen,
        last_observed_at=from_us(row.last_observed_at),
        lag_s=(row.last_seen - row.last_observed_at) / 1e6,
        missing=row.next_seq - row.received,
        state=state,
        why=why,
    )


def unknown_agent(agent: str) -> AgentView:
    """An agent that never posted may start at 0."""
    return AgentView(
        agent=agent,
        room=None,
        next_seq=0,
        first_seen=None,
        last_seen=None,
        last_observed_at=None,
        lag_s=None,
        missing=0,
        state="unknown",
    )
