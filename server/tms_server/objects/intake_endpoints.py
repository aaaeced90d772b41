"""Intake and the list of unknown tags over HTTP."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from tms_schemas.base import RoomId
from tms_schemas.objects import IntakeRequest, IntakeResult, UnknownTagPage
from tms_server.auth import Caller, require_see
from tms_server.db.paging import Cursor, Limit
from tms_server.db.session import ReadSession, Session
from tms_server.objects import intake as service
from tms_server.rooms.service import get_room

router = APIRouter(tags=["intake"])


@router.post("/intake", responses={201: {"model": IntakeResult, "description": "the object is new"}})
async def intake(
    body: IntakeRequest, caller: Caller, session: Session, request: Request, response: Response
) -> IntakeResult:
    """Register a thing in one call: its tag and a JAN, an SGTIN-96 tag alone, or a tag and a name.

    Without `room` the object goes where its tag was seen as unknown, if that was in one room. The same call again
    changes nothing; a tag that is registered as something else is a conflict.
    """
    result = await service.intake(session, request.state.clock, caller, body)
    response.status_code = 201 if result.created else 200
    return result


@router.get("/unknown-tags")
async def list_unknown_tags(
    caller: Caller, session: ReadSession, room: RoomId | None = None, limit: Limit = 100, cursor: Cursor = None
) -> UnknownTagPage:
    """Tags that were seen but belong to no object: where, when, how often."""
    if room is not None:
        require_see(caller, room)
        await get_room(session, room)
    return await service.list_unknown_tags(session, caller, room=room, cursor=cursor, limit=limit)
