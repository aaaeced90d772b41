"""The object list: text, room, category, and where in a room the belief puts things."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from sqlalchemy.ext.asyncio import AsyncSession

from tms_schemas.objects import ObjectPage
from tms_schemas.problem import ProblemItem
from tms_server.db.paging import cut, decode_cursor
from tms_server.db.session import ReadOnlySession
from tms_server.errors import Invalid, NotFound
from tms_server.keys.scopes import Principal
from tms_server.objects.repository import ObjectFilter, ObjectRepository
from tms_server.objects.search import words
from tms_server.objects.views import town_object
from tms_server.rooms.repository import RoomRepository
from tms_server.town import Town

#: A sum of probabilities may miss the bound by this much.
_ROUNDING = 1e-9


class Rectangle(NamedTuple):
    """Metres in the room frame, borders included."""

    x0: float
    y0: float
    x1: float
    y1: float

    def holds(self, xy: tuple[float, float]) -> bool:
        return self.x0 <= xy[0] <= self.x1 and self.y0 <= xy[1] <= self.y1


@dataclass(frozen=True, kw_only=True, slots=True)
class Search:
    q: str
    room: str | None
    category: str | None
    area: Rectangle | None
    min_p: float


def rectangle(text: str | None, room: str | None) -> Rectangle | None:
    """Raises ``Invalid`` for anything but four ordered finite numbers, and for an area of no room."""
    if text is None:
        return None
    try:
        sides = [float(part) for part in text.split(",")]
    except ValueError:
        sides = []
    if len(sides) != 4 or not all(map(math.isfinite, sides)) or sides[0] > sides[2] or sides[1] > sides[3]:
        why = "must be x0,y0,x1,y1 in metres with x0 <= x1 and y0 <= y1"
    elif room is None:
        why = "needs a room: every room has its own frame"
    else:
        return Rectangle(*sides)
    raise Invalid(f"area: {why}", items=[ProblemItem(where="area", why=why)])


async def find_objects(
    session: AsyncSession | ReadOnlySession,
    town: Town,
    caller: Principal,
    search: Search,
    *,
    cursor: str | None,
    limit: int,
) -> ObjectPage:
    """A page of objects by tag. Raises ``Invalid`` for a bad cursor and ``NotFound`` for an unknown room."""
    key = decode_cursor(cursor, 1)
    after = key[0] if key else None
    if search.room is not None and await RoomRepository(session).get(search.room) is None:
        raise NotFound(f"there is no room {search.room!r}", items=[ProblemItem(where="room", why="unknown room")])
    wanted = ObjectFilter(words=words(search.q), room=search.room, category=search.category, rooms=caller.rooms())
    objects = ObjectRepository(session)
    if search.area is None or search.room is None:
        rows = await objects.page(wanted, after=after, limit=limit)
    else:
        inside = await _inside(town, search.room, search.area, search.min_p)
        rows = await objects.page_among(wanted, inside, after=after, limit=limit)
    page, following = cut(rows, limit, lambda stored: (stored.object.tag,))
    return ObjectPage(items=[town_object(stored) for stored in page], next_cursor=following)


async def _inside(town: Town, room: str, area: Rectangle, min_p: float) -> list[str]:
    """Tags of the objects whose probability inside the area is at least ``min_p``."""
    found = []
    for placement in (await town.belief(room)).placements().objects:
        p = sum(place.p for place in placement.distribution if place.xy is not None and area.holds(place.xy))
        if p >= min_p - _ROUNDING:
            found.append(placement.tag)
    return found
