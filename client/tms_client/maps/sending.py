"""Upload of a map: which tiles changed against what the server has, in as many requests as they need."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from pydantic import ValidationError

from tms_client.api import Api
from tms_client.errors import NotFound, TownError
from tms_client.flows import Flow, first_error
from tms_client.maps.extra import need_numpy
from tms_schemas.maps import MapObject, MapVersion, TileIn, TilePlace, TileUpload, TownMap, VersionIn
from tms_schemas.tiles import Planes, pack, to_text

if TYPE_CHECKING:
    import numpy.typing as npt

    from tms_client.maps.cells import Intensity, Place

#: Characters and tiles of one request; the server bounds both.
_MOST_CHARACTERS, _MOST_TILES = 2_000_000, 1000
_PAGE = 1000


class Sent(NamedTuple):
    """What the server has as of ``version``: digests by place."""

    about: TownMap
    version: int
    digests: dict[Place, str]


class Sender:
    """Remembers what was uploaded last to each map, so that a robot sends its changes without asking."""

    def __init__(self, api: Api) -> None:
        self._api = api
        self._sent: dict[str, Sent] = {}

    def begin(self, map: str, base: int | None) -> Flow[Sent]:
        """What the server has as of ``base``. Raises ``NotFound``, and ``TownError`` without numpy."""
        need_numpy()
        if base is None and map in self._sent:
            return self._sent[map]
        return (yield from state(self._api, map, base))

    def tiles(
        self,
        sent: Sent,
        occupancy: npt.ArrayLike,
        origin: tuple[float, float],
        intensity: Intensity | None,
        snap: bool,
    ) -> dict[Place, Planes]:
        """Arrays as tiles of the map. Raises ``TownError``."""
        from tms_client.maps.cells import corner_of, split

        corner = corner_of(origin, sent.about.origin, sent.about.resolution, snap=snap)
        return split(corner, occupancy, intensity)

    def upload(
        self,
        sent: Sent,
        tiles: dict[Place, Planes],
        *,
        agent: str,
        note: str,
        objects: Sequence[MapObject] | None,
        whole: bool,
    ) -> Flow[MapVersion]:
        """Raises ``Conflict``; then the next upload without a base meets it again, rather than overwrite unseen."""
        map = sent.about.id
        self._sent[map] = sent
        try:
            made, self._sent[map] = yield from upload(
                self._api, sent, tiles, agent=agent, note=note, objects=objects, whole=whole
            )
        except NotFound:
            del self._sent[map]
            raise
        return made


def state(api: Api, map: str, version: int | None = None) -> Flow[Sent]:
    """Of a version, the newest by default. Raises ``NotFound``."""
    about = yield from api.get_map(map)
    wanted = about.version if version is None else version
    digests: dict[Place, str] = {}
    cursor: str | None = None
    while True:
        page = yield from api.map_tiles(map, version=wanted, data=False, limit=_PAGE, cursor=cursor)
        digests |= {(tile.x, tile.y): tile.digest for tile in page.tiles if tile.digest is not None}
        if (cursor := page.next_cursor) is None:
            return Sent(about, wanted, digests)


def upload(
    api: Api,
    sent: Sent,
    tiles: dict[Place, Planes],
    *,
    agent: str,
    note: str,
    objects: Sequence[MapObject] | None,
    whole: bool,
) -> Flow[tuple[MapVersion, Sent]]:
    """The version on top of ``sent``.

    Raises:
        Conflict: another one is the newest.
        TownError: there are too many tiles, or what is said of the version is nothing that a version can hold.
    """
    digests = {place: planes.digest for place, planes in tiles.items()}
    changed = [place for place in sorted(tiles) if sent.digests.get(place) != digests[place]]
    gone = sorted(sent.digests.keys() - tiles.keys()) if whole else []
    packed = {digests[place]: to_text(pack(tiles[place])) for place in changed}
    if sum(len(text) for text in packed.values()) > _MOST_CHARACTERS:
        for part in _parts(list(packed.values())):
            yield from api.post_tiles(sent.about.id, TileUpload(tiles=part))
        parts = [TileIn(x=x, y=y, digest=digests[x, y]) for x, y in changed]
    else:
        parts = [TileIn(x=x, y=y, data=packed[digests[x, y]]) for x, y in changed]
    try:
        body = VersionIn(
            base=sent.version,
            agent=agent,
            note=note,
            tiles=parts,
            removed=[TilePlace(x=x, y=y) for x, y in gone],
            objects=None if objects is None else list(objects),
        )
    except ValidationError as error:
        raise TownError(f"the version cannot be sent: {first_error(error)}") from error
    made = yield from api.post_version(sent.about.id, body)
    kept = digests if whole else sent.digests | digests
    return made, Sent(sent.about, made.version, kept)


def _parts(texts: list[str]) -> list[list[str]]:
    parts: list[list[str]] = [[]]
    size = 0
    for text in texts:
        if parts[-1] and (size + len(text) > _MOST_CHARACTERS or len(parts[-1]) >= _MOST_TILES):
            parts.append([])
            size = 0
        parts[-1].append(text)
        size += len(text)
    return parts
