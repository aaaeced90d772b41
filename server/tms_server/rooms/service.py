"""Rooms: put, get, list. A change is a record of the room's log, since the belief is folded with it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from sqlalchemy.ext.asyncio import AsyncSession

from tms_schemas.problem import ProblemItem
from tms_schemas.rooms import Room, RoomIn, RoomPage
from tms_server.clock import Clock
from tms_server.db.paging import cut, decode_cursor
from tms_server.db.session import ReadOnlySession
from tms_server.db.tables import RoomRow
from tms_server.db.times import from_us, to_us
from tms_server.db.turns import take_turn
from tms_server.errors import Invalid, NotFound
from tms_server.log.bodies import RoomChanged
from tms_server.log.registry import append_registry
from tms_server.placement.parameters import ParameterError, Parameters
from tms_server.rooms.polygons import Ring, require_area
from tms_server.rooms.repository import RoomRepository


async def put_room(session: AsyncSession, clock: Clock, room: str, fields: RoomIn) -> tuple[Room, bool]:
    """Store the room; true where it is new. The same body again changes nothing, in the table and in the log.

    Raises:
        Invalid: a polygon without area, a zone listed twice, or a parameter that the belief does not have.
    """
    require_area(_polygons(fields))
    _check_zones(fields)
    _check_parameters(fields.params)
    await take_turn(session)
    rooms = RoomRepository(session)
    await rooms.lock([room])
    row = await rooms.get(room)
    body, now = fields.model_dump_json(by_alias=True), clock.now()
    if row is not None and row.body == body:
        return _room(row), False
    created = row is None
    if row is None:
        row = RoomRow(room=room, body=body, created_at=to_us(now), updated_at=to_us(now), head=0)
        rooms.add(row)
    else:
        row.body, row.updated_at = body, to_us(now)
    await append_registry(session, room, RoomChanged(room=fields), now=now)
    return _room(row), created


async def get_room(session: AsyncSession | ReadOnlySession, room: str) -> Room:
    """Raises ``NotFound``."""
    row = await RoomRepository(session).get(room)
    if row is None:
        raise NotFound(f"there is no room {room!r}")
    return _room(row)


async def list_rooms(
    session: AsyncSession | ReadOnlySession, *, among: Iterable[str] | None, cursor: str | None, limit: int
) -> RoomPage:
    """Rooms by id; ``among`` restricts them to those that a key may see. Raises ``Invalid`` for a bad cursor."""
    after = decode_cursor(cursor, 1)
    rows = await RoomRepository(session).page(among=among, after=after[0] if after else None, limit=limit)
    page, following = cut(rows, limit, lambda row: (row.room,))
    return RoomPage(items=[_room(row) for row in page], next_cursor=following)


def _room(row: RoomRow) -> Room:
    fields = RoomIn.model_validate_json(row.body)
    return Room(id=row.room, created_at=from_us(row.created_at), updated_at=from_us(row.updated_at), **dict(fields))


def _polygons(fields: RoomIn) -> Iterator[tuple[str, Ring]]:
    yield "outline", fields.outline
    for i, furniture in enumerate(fields.furniture):
        yield f"furniture/{i}/polygon", furniture.polygon
        for j, surface in enumerate(furniture.surfaces):
            yield f"furniture/{i}/surfaces/{j}/polygon", surface.polygon
    for i, sensor in enumerate(fields.sensors):
        for j, zone in enumerate(sensor.zones):
            yield f"sensors/{i}/zones/{j}/polygon", zone.polygon


def _check_zones(fields: RoomIn) -> None:
    """A ``raw_read`` names a zone of its agent, so the name must be unique there."""
    for i, sensor in enumerate(fields.sensors):
        zones = [zone.id for zone in sensor.zones]
        if len(set(zones)) != len(zones):
            why = f"a zone of {sensor.agent} is listed twice"
            raise Invalid(why, items=[ProblemItem(where=f"sensors/{i}/zones", why=why)])


def _check_parameters(params: Mapping[str, Any]) -> None:
    try:
        Parameters.of(params, profile="live")
    except (ParameterError, OverflowError) as error:
        raise Invalid(f"params: {error}", items=[ProblemItem(where="params", why=str(error))]) from error
