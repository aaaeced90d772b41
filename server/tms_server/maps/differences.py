"""What changed between two versions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tms_schemas.maps import MapDiff, MapObject, MapObjects, ObjectChange, TilePlace
from tms_schemas.tiles import UNKNOWN
from tms_server.db.tables import MapRow
from tms_server.maps.cells import Bytes, free, occupied, tile_cells
from tms_server.maps.reading import objects_of
from tms_server.maps.service import AnySession, find_version
from tms_server.maps.tile_repository import Place, TileRepository


class Pair(NamedTuple):
    """The tiles that differ between two versions, packed: before and after (None: no tile)."""

    before: int
    after: int
    tiles: dict[Place, tuple[bytes | None, bytes | None]]
    objects: list[ObjectChange]

    def counts(self) -> MapDiff:
        """Decodes every tile."""
        counts = np.zeros(len(_KINDS) + 1, dtype=np.int64)
        for old, new in self.tiles.values():
            counts += np.bincount(kinds(tile_cells(old), tile_cells(new)).ravel(), minlength=len(counts))
        return MapDiff(
            before=self.before,
            after=self.after,
            tiles=[TilePlace(x=x, y=y) for x, y in sorted(self.tiles)],
            objects=self.objects,
            **{name: int(count) for name, count in zip(_KINDS, counts[1:], strict=True)},
        )


_KINDS = ("became_occupied", "became_free", "became_known", "became_unknown")


def kinds(old: Bytes, new: Bytes) -> Bytes:
    """What became of each cell: 0 nothing of note, else 1 + the index in occupied, free, known, unknown."""
    found = np.zeros(old.shape, dtype=np.uint8)
    was, now = old != UNKNOWN, new != UNKNOWN
    found[was & now & occupied(new) & ~occupied(old)] = 1
    found[was & now & free(new) & ~free(old)] = 2
    found[~was & now] = 3
    found[was & ~now] = 4
    return found


class Least(NamedTuple):
    """What moved less and turned less, and is in the same state, has not moved."""

    m: float
    rad: float


ANY = Least(0.0, 0.0)


async def pair(session: AnySession, row: MapRow, before: int, after: int | None, least: Least = ANY) -> Pair:
    """Raises ``NotFound``."""
    old, new = await find_version(session, row, before), await find_version(session, row, after)
    tiles = TileRepository(session, row.map)
    was = {} if old is None else await tiles.at(old.version)
    now = {} if new is None else await tiles.at(new.version)
    places = [place for place in was.keys() | now.keys() if was.get(place) != now.get(place)]
    bodies = await tiles.bodies(digest for place in places for digest in (was.get(place), now.get(place)) if digest)
    return Pair(
        old.version if old else 0,
        new.version if new else 0,
        {place: (bodies.get(was.get(place, "")), bodies.get(now.get(place, ""))) for place in places},
        _object_changes(await objects_of(session, row, before), await objects_of(session, row, after), least),
    )


def _object_changes(before: MapObjects, after: MapObjects, least: Least) -> list[ObjectChange]:
    old, new = ({one.tag: one for one in side.objects} for side in (before, after))
    changes = [_change(tag, old.get(tag), new.get(tag)) for tag in sorted(old.keys() | new.keys())]
    return [one for one in changes if _counts(one, least)]


def _change(tag: str, before: MapObject | None, after: MapObject | None) -> ObjectChange:
    if before is None or after is None:
        return ObjectChange(tag=tag, before=before, after=after)
    return ObjectChange(
        tag=tag,
        before=before,
        after=after,
        moved_m=math.hypot(after.x - before.x, after.y - before.y),
        turned_rad=abs(math.remainder(after.theta - before.theta, math.tau)),
    )


def _counts(change: ObjectChange, least: Least) -> bool:
    """To be seen again is no change."""
    if change.moved_m is None or change.turned_rad is None or change.before is None or change.after is None:
        return True
    moved = change.moved_m > 0 and change.moved_m >= least.m
    turned = change.turned_rad > 0 and change.turned_rad >= least.rad
    return moved or turned or change.before.state != change.after.state
