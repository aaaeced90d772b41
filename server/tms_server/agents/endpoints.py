"""``GET /v1/agents``: who is alive, since when, how late; and with which number an agent goes on."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request

from tms_schemas.agents import AgentPage, AgentView
from tms_schemas.base import AgentId
from tms_server.agents.repository import AgentRepository
from tms_server.agents.service import agent_view, unknown_agent
from tms_server.auth import Caller, require_see
from tms_server.db.session import ReadSession
from tms_server.db.tables import AgentRow

router = APIRouter(tags=["agents"])
Limit = Annotated[int, Query(ge=1, le=1000)]
Cursor = Annotated[AgentId | None, Query(description="next_cursor of the page before")]


@router.get("/agents")
async def list_agents(
    request: Request, caller: Caller, session: ReadSession, cursor: Cursor = None, limit: Limit = 100
) -> AgentPage:
    """Agents by name, of the rooms that the caller may see."""
    found = await AgentRepository(session).page(after=cursor or "", limit=limit + 1, rooms=caller.rooms())
    items = [_view(request, row) for row in found[:limit]]
    return AgentPage(items=items, next_cursor=items[-1].agent if len(found) > limit else None)


@router.get("/agents/{agent}")
async def get_agent(request: Request, agent: AgentId, caller: Caller, session: ReadSession) -> AgentView:
    """One agent; one that never posted is ``unknown`` and starts at ``next_seq`` 0."""
    row = await AgentRepository(session).get(agent)
    if row is None:
        return unknown_agent(agent)
    require_see(caller, row.room)
    return _view(request, row)


def _view(request: Request, row: AgentRow) -> AgentView:
    state, now = request.state, request.state.clock.now()
    return agent_view(
        row, now=now, silent_after_s=state.settings.silent_after_s, dispute=state.disputes.of(row.agent, now)
    )
