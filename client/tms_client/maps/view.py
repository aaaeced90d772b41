"""A map as a robot holds it: tiles it fetched once, as arrays; only changed tiles are fetched again."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from tms_client.api import Api
from tms_client.errors import BadAnswer
from tms_client.flows import Flow
from tms_client.maps.extra import need_numpy
from tms_schemas.maps import MapObject, TownMap
from tms_schemas.tiles import Planes, TileError, from_text, unpack

if TYPE_CHECKING:
    from tms_client.maps.cells import Floats, Intensity, Place, Window

#: Tiles per page.
_PAGE = 200


@dataclass(frozen=True, kw_only=True, slots=True)
class Held:
    """What was fetched of a map, as of ``version``."""

    about: TownMap
    version: int = 0
    tiles: Mapping[Place, Planes] = field(default_factory=dict)
    objects: list[MapObject] = field(default_factory=list)


class MapView:
    """One version of a map. Arrays are (H, W), row 0 has the lowest y, [0, 0] is at ``origin`` in the map frame."""

    def __init__(self, held: Held) -> None:
        self._held = held
        self._window: Window | None = None

    @property
    def name(self) -> str:
        return self._held.about.id

    @property
    def room(self) -> str:
        return self._held.about.room

    @property
    def version(self) -> int:
        return self._held.version

    @property
    def resolution(self) -> float:
        """Metres per cell."""
        return self._held.about.resolution

    @property
    def map_to_room(self) -> tuple[float, float, float] | None:
        """Pose (x, y, theta) of the map frame in the room; None while nobody knows it."""
        return self._held.about.map_to_room

    @property
    def objects(self) -> list[MapObject]:
        """The semi-dynamic objects, in the map frame."""
        return list(self._held.objects)

    @property
    def occupancy(self) -> Floats:
        """Probability that a cell is occupied, NaN where nothing is known; float32."""
        return self._arrays.occupancy

    @property
    def intensity(self) -> Intensity | None:
        """Mean, variance and count of the received light, where the map has them."""
        return self._arrays.intensity

    @property
    def origin(self) -> tuple[float, float]:
        """Lower left corner of the arrays in the map frame; it moves as the map grows."""
        (x, y), about = self._arrays.corner, self._held.about
        return about.origin[0] + x * about.resolution, about.origin[1] + y * about.resolution

    def at(self, x: float, y: float) -> float:
        """Probability that the place (metres, map frame) is occupied; NaN where nothing is known or outside."""
        column, row = (math.floor((at - zero) / self.resolution) for at, zero in zip((x, y), self.origin, strict=True))
        height, width = self.occupancy.shape
        return float(self.occupancy[row, column]) if 0 <= row < height and 0 <= column < width else math.nan

    @property
    def _arrays(self) -> Window:
        if self._window is None:
            from tms_client.maps.cells import join

            self._window = join(self._held.tiles)
        return self._window

    def _take(self, held: Held) -> bool:
        """True where it is another version than before."""
        before, self._held = self._held, held
        if before.tiles is not held.tiles:
            self._window = None
        return before.version != held.version or before.about.created_at != held.about.created_at


def fetch(api: Api, map: str, version: int | None) -> Flow[Held]:
    """All of a version, the newest by default. Raises ``NotFound``, and ``TownError`` without numpy."""
    need_numpy()
    about = yield from api.get_map(map)
    return (yield from _follow(api, Held(about=about), about.version if version is None else version))


def catch_up(api: Api, held: Held) -> Flow[Held]:
    """The newest version; only the tiles that changed since are fetched. Raises ``NotFound``."""
    about = yield from api.get_map(held.about.id)
    anew = about.created_at != held.about.created_at  # deleted meanwhile
    return (yield from _follow(api, Held(about=about) if anew else replace(held, about=about), about.version))


def _follow(api: Api, held: Held, version: int) -> Flow[Held]:
    if version == held.version:
        return held
    tiles = dict(held.tiles)
    cursor: str | None = None
    while True:
        page = yield from api.map_tiles(held.about.id, since=held.version, version=version, limit=_PAGE, cursor=cursor)
        for tile in page.tiles:
            if tile.digest is None:
                tiles.pop((tile.x, tile.y), None)
            else:
                tiles[tile.x, tile.y] = _read(tile.data)
        if (cursor := page.next_cursor) is None:
            break
    objects = yield from api.map_objects(held.about.id, version=version)
    return replace(held, version=version, tiles=tiles, objects=objects.objects)


def _read(data: str | None) -> Planes:
    try:
        return unpack(from_text(data or ""))
    except TileError as error:
        raise BadAnswer(f"a tile of the map cannot be read: {error}") from error
