"""``town.map`` and ``town.maps``, blocking; ``awaited`` has the same for asyncio."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, TypeVar

from tms_client.api import Api
from tms_client.connection import Connection
from tms_client.flows import Flow
from tms_client.maps.sending import Sender
from tms_client.maps.view import Held, MapView, catch_up, fetch
from tms_schemas.maps import Layer, MapDiff, MapIn, MapObject, MapVersion, PgmMode, TownMap

if TYPE_CHECKING:
    import numpy.typing as npt

    from tms_client.maps.cells import Intensity

T = TypeVar("T")


class Map(MapView):
    """A map that can catch up with the server."""

    def __init__(self, held: Held, connection: Connection, api: Api) -> None:
        super().__init__(held)
        self._connection, self._api = connection, api

    def update(self) -> bool:
        """Fetch the tiles that changed since; true where there is a newer version. Raises ``NotFound``."""
        return self._take(self._connection.run(catch_up(self._api, self._held)))


class Maps:
    """Maps of all rooms that the key may see."""

    def __init__(self, connection: Connection, api: Api) -> None:
        self._connection, self._api = connection, api
        self._sender = Sender(api)

    def fetch(self, map: str, version: int | None = None) -> Map:
        """The same as ``town.map``."""
        return Map(self._run(fetch(self._api, map, version)), self._connection, self._api)

    def get(self, map: str) -> TownMap:
        return self._run(self._api.get_map(map))

    def put(self, map: str, fields: MapIn) -> TownMap:
        return self._run(self._api.put_map(map, fields))

    def delete(self, map: str) -> None:
        """With all its versions."""
        self._run(self._api.delete_map(map))

    def list(self, room: str | None = None) -> Iterator[TownMap]:
        cursor: str | None = None
        while True:
            page = self._run(self._api.maps(room, cursor=cursor))
            yield from page.items
            if (cursor := page.next_cursor) is None:
                return

    def versions(self, map: str) -> Iterator[MapVersion]:
        """The newest first."""
        cursor: str | None = None
        while True:
            page = self._run(self._api.map_versions(map, cursor=cursor))
            yield from page.items
            if (cursor := page.next_cursor) is None:
                return

    def objects(self, map: str, version: int | None = None) -> Sequence[MapObject]:
        """The semi-dynamic objects as a version has them, the newest by default."""
        return self._run(self._api.map_objects(map, version)).objects

    def diff(
        self, map: str, before: int, after: int | None = None, *, least_m: float = 0.0, least_rad: float = 0.0
    ) -> MapDiff:
        """What changed from one version to another, the newest by default.

        An object that moved less than ``least_m`` and turned less than ``least_rad`` is left out.
        """
        return self._run(self._api.map_diff(map, before, after, least_m, least_rad))

    def png(self, map: str, version: int | None = None, *, layer: Layer = "occupancy") -> bytes:
        """A picture."""
        return self._run(self._api.map_file(map, ".png", version=version, layer=layer))

    def diff_png(self, map: str, before: int, after: int | None = None) -> bytes:
        """A picture: red became occupied, blue became free, yellow became known, violet became unknown."""
        return self._run(self._api.map_file(map, "/diff.png", before=before, after=after))

    def pgm(self, map: str, version: int | None = None, *, mode: PgmMode = "trinary") -> bytes:
        """The image for ``map_server``; its description is ``yaml``."""
        return self._run(self._api.map_file(map, ".pgm", version=version, mode=mode))

    def yaml(self, map: str, version: int | None = None, *, mode: PgmMode = "trinary") -> str:
        return self._run(self._api.map_file(map, ".yaml", version=version, mode=mode)).decode()

    def upload(
        self,
        map: str,
        occupancy: npt.ArrayLike,
        origin: tuple[float, float],
        *,
        agent: str,
        intensity: Intensity | None = None,
        objects: Sequence[MapObject] | None = None,
        note: str = "",
        base: int | None = None,
        whole: bool = True,
        snap: bool = False,
    ) -> MapVersion:
        """Make a version of arrays; only tiles that differ from those uploaded last travel.

        Args:
            occupancy: (H, W) probabilities, NaN unknown, row 0 with the lowest y.
            origin: lower left corner of ``occupancy[0, 0]``, metres in the map frame.
            objects: all semi-dynamic objects; None leaves those there are.
            base: the version that this one follows; the one uploaded last by default, at first the newest.
            whole: False leaves the tiles that the arrays do not touch.
            snap: shift the arrays to the grid of the map, by up to half a cell.

        Raises:
            Conflict: somebody else made a version after ``base``. Look at it, then name it as the base.
            TownError: the arrays are no map, or are off its grid.
        """
        sent = self._run(self._sender.begin(map, base))
        tiles = self._sender.tiles(sent, occupancy, origin, intensity, snap)
        return self._run(self._sender.upload(sent, tiles, agent=agent, note=note, objects=objects, whole=whole))

    def _run(self, flow: Flow[T]) -> T:
        return self._connection.run(flow)
