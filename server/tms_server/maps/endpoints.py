"""Maps over HTTP; their versions and tiles, and the files made of them, beside them."""

from __future__ import annotations

import contextlib
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from tms_schemas.base import RoomId
from tms_schemas.maps import DoorsAnswer, DoorState, MapId, MapIn, MapPage, TownMap
from tms_server.auth import Admin, Caller, require_observe, require_see
from tms_server.db.paging import Cursor, Limit
from tms_server.db.session import ReadSession, Session
from tms_server.errors import NotFound
from tms_server.maps import doors, file_endpoints, service, version_endpoints
from tms_server.rooms import service as rooms

maps = APIRouter(tags=["maps"])


@maps.get("/maps")
async def list_maps(
    caller: Caller, session: ReadSession, room: RoomId | None = None, limit: Limit = 100, cursor: Cursor = None
) -> MapPage:
    """The maps of rooms that the key may see, by id."""
    if room is not None:
        require_see(caller, room)
    return await service.list_maps(session, room=room, among=caller.rooms(), cursor=cursor, limit=limit)


@maps.get("/maps/{map}")
async def get_map(map: MapId, caller: Caller, session: ReadSession) -> TownMap:
    """Room, resolution, origin, where the map lies in the room, and the newest version."""
    row = await service.find(session, map)
    require_see(caller, row.room)
    return service.town_map(row)


@maps.put("/maps/{map}", responses={201: {"model": TownMap, "description": "the map is new"}})
async def put_map(
    map: MapId, body: MapIn, caller: Caller, session: Session, request: Request, response: Response
) -> TownMap:
    """Make the map or replace what is said of it; for agents that may observe in its room.

    The same body again changes nothing. Room, resolution and origin stay once the map has a version.
    """
    require_observe(caller, body.room)
    with contextlib.suppress(NotFound):
        require_observe(caller, (await service.find(session, map)).room)
    answer, created = await service.put_map(session, request.state.clock, map, body)
    response.status_code = 201 if created else 200
    return answer


@maps.delete("/maps/{map}", status_code=204)
async def delete_map(map: MapId, _: Admin, session: Session, request: Request) -> None:
    """Forget the map with all its versions."""
    await service.delete_map(session, request.state.clock, map)


@maps.get("/rooms/{room}/doors")
async def get_doors(
    room: RoomId,
    caller: Caller,
    session: ReadSession,
    state: Annotated[DoorState | None, Query(description="only doors in this state")] = None,
) -> DoorsAnswer:
    """Which doors are open: as the newest versions of the room's maps have them, with the time they were seen.

    A door is an object of a map whose shape has a class that begins with `door`, or that a robot says is open or
    closed.
    """
    require_see(caller, room)
    await rooms.get_room(session, room)
    return await doors.doors_of(session, room, state)


# After the routes: a router takes over those that exist when it includes another. Files first: ``{map}`` would take
# ``corridor.png`` for a map.
router = APIRouter()
for part in (file_endpoints.router, maps, version_endpoints.router):
    router.include_router(part)
