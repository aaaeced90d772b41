"""Maps: put, get, list, delete, and their versions. What changed is told by a record of the room's log."""

from __future__ import annotations

import json
from collections.abc import Iterable

from sqlalchemy.ext.asyncio import AsyncSession

from tms_schemas.maps import MapIn, MapPage, MapVersion, TownMap, VersionPage
from tms_schemas.problem import ProblemItem
from tms_server.clock import Clock
from tms_server.db.paging import cut, decode_cursor
from tms_server.db.session import ReadOnlySession
from tms_server.db.tables import MapRow, MapVersionRow
from tms_server.db.times import from_us, to_us
from tms_server.db.turns import take_turn
from tms_server.errors import Conflict, Invalid, NotFound
from tms_server.log.bodies import MapChanged
from tms_server.log.registry import append_registry
from tms_server.maps.repository import MapRepository
from tms_server.rooms.repository import RoomRepository

AnySession = AsyncSession | ReadOnlySession


async def put_map(session: AsyncSession, clock: Clock, map: str, fields: MapIn) -> tuple[TownMap, bool]:
    """Store the map; true where it is new. The same body again changes nothing.

    Raises:
        Invalid: an unknown room.
        Conflict: another room, resolution or origin for a map that has versions.
    """
    await take_turn(session)
    if await RoomRepository(session).get(fields.room) is None:
        why = f"there is no room {fields.room!r}"
        raise Invalid(f"room: {why}", items=[ProblemItem(where="room", why="unknown room")])
    maps = MapRepository(session)
    row, now = await maps.lock(map), clock.now()
    columns = _columns(fields)
    if row is not None and all(getattr(row, name) == value for name, value in columns.items()):
        return town_map(row), False
    created = row is None
    if row is None:
        row = MapRow(map=map, version=0, created_at=to_us(now), updated_at=to_us(now), **columns)
        maps.add(row)
    else:
        _require_same_place(row, columns)
        for name, value in columns.items():
            setattr(row, name, value)
        row.updated_at = to_us(now)
    await append_registry(session, fields.room, MapChanged(map=map, version=row.version), now=now)
    return town_map(row), created


async def delete_map(session: AsyncSession, clock: Clock, map: str) -> None:
    """With all versions. Raises ``NotFound``."""
    await take_turn(session)
    maps = MapRepository(session)
    row = await maps.lock(map)
    if row is None:
        raise unknown(map)
    await maps.delete(map)
    session.expunge(row)
    await append_registry(session, row.room, MapChanged(map=map, version=None), now=clock.now())


async def find(session: AnySession, map: str) -> MapRow:
    """Raises ``NotFound``."""
    row = await MapRepository(session).get(map)
    if row is None:
        raise unknown(map)
    return row


async def list_maps(
    session: AnySession, *, room: str | None, among: Iterable[str] | None, cursor: str | None, limit: int
) -> MapPage:
    """Maps by id; ``among`` restricts them to the rooms that a key may see. Raises ``Invalid`` for a bad cursor."""
    after = decode_cursor(cursor, 1)
    rows = await MapRepository(session).page(room=room, among=among, after=after[0] if after else None, limit=limit)
    page, following = cut(rows, limit, lambda row: (row.map,))
    return MapPage(items=[town_map(row) for row in page], next_cursor=following)


async def list_versions(session: AnySession, map: str, *, cursor: str | None, limit: int) -> VersionPage:
    """The newest first. Raises ``Invalid`` for a bad cursor."""
    after = whole_numbers(decode_cursor(cursor, 1))
    rows = await MapRepository(session).versions(map, before=after[0] if after else None, limit=limit)
    page, following = cut(rows, limit, lambda row: (str(row.version),))
    return VersionPage(items=[map_version(row) for row in page], next_cursor=following)


async def find_version(session: AnySession, row: MapRow, version: int | None) -> MapVersionRow | None:
    """The version asked for, the newest by default; None is the empty map before the first. Raises ``NotFound``."""
    wanted = row.version if version is None else version
    if wanted == 0:
        return None
    found = await MapRepository(session).version(row.map, wanted)
    if found is None:
        raise NotFound(f"map {row.map!r} has no version {wanted}; the newest is {row.version}")
    return found


def whole_numbers(key: tuple[str, ...] | None) -> tuple[int, ...] | None:
    """The numbers of a cursor's key. Raises ``Invalid``."""
    try:
        return None if key is None else tuple(_bounded(part) for part in key)
    except ValueError:
        raise Invalid(
            "this is no cursor", items=[ProblemItem(where="cursor", why="not given out by this list")]
        ) from None


def town_map(row: MapRow) -> TownMap:
    return TownMap(
        id=row.map,
        room=row.room,
        name=row.name,
        resolution=row.resolution,
        origin=(row.origin_x, row.origin_y),
        map_to_room=None if row.map_to_room is None else json.loads(row.map_to_room),
        version=row.version,
        created_at=from_us(row.created_at),
        updated_at=from_us(row.updated_at),
    )


def map_version(row: MapVersionRow) -> MapVersion:
    return MapVersion(
        version=row.version,
        created_at=from_us(row.created_at),
        agent=row.agent,
        note=row.note,
        bounds=bounds_of(row),
        changed=row.changed,
    )


def bounds_of(row: MapVersionRow | None) -> tuple[int, int, int, int] | None:
    """x0, y0, x1, y1 in cells; None where nothing is known."""
    return None if row is None or row.bounds is None else json.loads(row.bounds)


def unknown(map: str) -> NotFound:
    return NotFound(f"there is no map {map!r}")


def _columns(fields: MapIn) -> dict[str, object]:
    return {
        "room": fields.room,
        "name": fields.name,
        "resolution": fields.resolution,
        "origin_x": fields.origin[0],
        "origin_y": fields.origin[1],
        "map_to_room": None if fields.map_to_room is None else json.dumps(fields.map_to_room),
    }


def _require_same_place(row: MapRow, columns: dict[str, object]) -> None:
    moved = [name for name in ("room", "resolution", "origin_x", "origin_y") if getattr(row, name) != columns[name]]
    if row.version and moved:
        field = moved[0].partition("_")[0]
        raise Conflict(f"{field}: map {row.map!r} has versions, which hold for the {field} it has; make another map")


def _bounded(text: str) -> int:
    number = int(text)
    if not -(2**31) <= number < 2**31:
        raise ValueError
    return number
