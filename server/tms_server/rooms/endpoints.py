"""Rooms over HTTP."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from tms_schemas.base import RoomId
from tms_schemas.rooms import Room, RoomIn, RoomPage
from tms_server.auth import Admin, Caller, require_see
from tms_server.db.paging import Cursor, Limit
from tms_server.db.session import ReadSession, Session
from tms_server.rooms import service

router = APIRouter(tags=["rooms"])


@router.get("/rooms")
async def list_rooms(caller: Caller, session: ReadSession, limit: Limit = 100, cursor: Cursor = None) -> RoomPage:
    """The rooms that the key may see, by id."""
    return await service.list_rooms(session, among=caller.rooms(), cursor=cursor, limit=limit)


@router.get("/rooms/{room}")
async def get_room(room: RoomId, caller: Caller, session: ReadSession) -> Room:
    """Frame, outline, furniture with surfaces, sensors with zones, parameters of the belief."""
    require_see(caller, room)
    return await service.get_room(session, room)


@router.put("/rooms/{room}", responses={201: {"model": Room, "description": "the room is new"}})
async def put_room(
    room: RoomId, body: RoomIn, _: Admin, session: Session, request: Request, response: Response
) -> Room:
    """Make the room or replace what is known of it. The same body again changes nothing."""
    answer, created = await service.put_room(session, request.state.clock, room, body)
    response.status_code = 201 if created else 200
    return answer
