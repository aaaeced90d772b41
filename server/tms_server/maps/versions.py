"""A new version out of the tiles that changed: whole or not at all, once however often it is asked for."""

from __future__ import annotations

import hashlib
import json
from datetime import timedelta

from sqlalchemy.ext.asyncio import AsyncSession

from tms_schemas.maps import MapObject, MapVersion, TilesKept, TileUpload, VersionIn
from tms_schemas.problem import ProblemItem
from tms_server.clock import Clock
from tms_server.db.tables import MapRow, MapVersionRow
from tms_server.db.times import to_us
from tms_server.errors import Conflict, Invalid
from tms_server.log.bodies import MapChanged
from tms_server.log.registry import append_registry
from tms_server.maps.content import BLANK, MAX_CELLS, Content, read_tiles
from tms_server.maps.repository import MapRepository
from tms_server.maps.service import map_version, unknown
from tms_server.maps.tile_repository import Place, TileRepository

#: Tiles that no version names are kept so long for the version that will, and looked for every so many versions.
_KEPT = timedelta(hours=1)
_CLEAN_EVERY = 16


def read_version(body: VersionIn) -> dict[Place, Content]:
    """The tiles that came packed, checked. Raises ``Invalid`` naming the bad ones."""
    sent = [(i, tile, tile.data) for i, tile in enumerate(body.tiles) if tile.data is not None]
    contents = read_tiles((f"tiles/{i}/data", data) for i, _, data in sent)
    return {(tile.x, tile.y): content for (_, tile, _), content in zip(sent, contents, strict=True)}


def read_upload(body: TileUpload) -> list[Content]:
    """Raises ``Invalid`` naming the bad ones."""
    return read_tiles((f"tiles/{i}", text) for i, text in enumerate(body.tiles))


async def keep_tiles(session: AsyncSession, clock: Clock, map: str, contents: list[Content]) -> TilesKept:
    """Keep tiles for a version to come. Raises ``NotFound``."""
    if await MapRepository(session).lock(map) is None:
        raise unknown(map)
    await TileRepository(session, map).keep(contents, to_us(clock.now()))
    return TilesKept(digests=[one.digest for one in contents])


async def post_version(
    session: AsyncSession, clock: Clock, map: str, body: VersionIn, contents: dict[Place, Content]
) -> tuple[MapVersion, bool]:
    """The version, and whether it is new. What changes nothing makes none; nor does the same request again.

    Raises:
        NotFound: there is no such map.
        Conflict: another version than ``base`` is the newest.
        Invalid: a digest that the map does not hold, or a map that would become too large.
    """
    maps, tiles = MapRepository(session), TileRepository(session, map)
    row, now = await maps.lock(map), clock.now()
    if row is None:
        raise unknown(map)
    request = _digest(body, contents)
    if body.base != row.version:
        return map_version(await _earlier(maps, row, body.base, request)), False
    await tiles.keep(contents.values(), to_us(now))
    changes = await _changes(tiles, body, contents)
    objects = await _new_objects(maps, row, body)
    if row.version and not changes and objects is None:
        return map_version(await _newest(maps, row)), False
    row.version, row.updated_at = row.version + 1, to_us(now)
    await tiles.put(row.version, changes)
    made = MapVersionRow(
        map=map,
        version=row.version,
        created_at=to_us(now),
        agent=body.agent,
        note=body.note,
        request=request,
        bounds=await _bounds(tiles),
        changed=len(changes),
        objects=objects,
    )
    maps.add(made)
    if row.version % _CLEAN_EVERY == 0:
        await tiles.forget_unnamed(to_us(now - _KEPT))
    await append_registry(session, row.room, MapChanged(map=map, version=row.version), now=now)
    return map_version(made), True


def objects_json(objects: list[MapObject]) -> str:
    return json.dumps([_written(one) for one in sorted(objects, key=lambda one: one.tag)], ensure_ascii=False)


def _written(one: MapObject) -> dict[str, object]:
    """Fields that came later are left out where nothing is said: so versions made before them compare as equal."""
    fields = one.model_dump(mode="json")
    return {name: value for name, value in fields.items() if value is not None or name == "state"}


async def _earlier(maps: MapRepository, row: MapRow, base: int, request: str) -> MapVersionRow:
    """The version that this very request made before. Raises ``Conflict``."""
    made = await maps.version(row.map, base + 1)
    if made is None or made.request != request:
        raise Conflict(
            f"base: the newest version of map {row.map!r} is {row.version}, not {base}; take over what changed and "
            "send again",
            items=[ProblemItem(where="base", why=f"the newest version is {row.version}")],
        )
    return made


async def _newest(maps: MapRepository, row: MapRow) -> MapVersionRow:
    found = await maps.version(row.map, row.version)
    assert found is not None
    return found


async def _changes(tiles: TileRepository, body: VersionIn, contents: dict[Place, Content]) -> dict[Place, str | None]:
    """Digest by place where it is another than in the newest version; None where there is no tile any more."""
    wanted: dict[Place, str | None] = {(one.x, one.y): None for one in body.removed}
    wanted |= {place: content.digest for place, content in contents.items()}
    by_digest = {(one.x, one.y): one.digest for one in body.tiles if one.digest is not None}
    known = await tiles.known(by_digest.values())
    bad = [
        ProblemItem(where=f"tiles/{i}/digest", why="the map has no tile of this content")
        for i, one in enumerate(body.tiles)
        if one.digest is not None and one.digest not in known
    ]
    if bad:
        raise Invalid(f"{bad[0].where}: {bad[0].why}", items=bad[:100])
    wanted = {place: None if digest in BLANK else digest for place, digest in (wanted | by_digest).items()}
    now = await tiles.now_at(list(wanted))
    return {place: digest for place, digest in wanted.items() if now.get(place) != digest}


async def _new_objects(maps: MapRepository, row: MapRow, body: VersionIn) -> str | None:
    if body.objects is None:
        return None
    objects = objects_json(body.objects)
    before = await maps.objects(row.map, row.version)
    return None if objects == (before or "[]") else objects


async def _bounds(tiles: TileRepository) -> str | None:
    bounds = await tiles.bounds()
    if bounds is None:
        return None
    width, height = bounds[2] - bounds[0], bounds[3] - bounds[1]
    if width * height > MAX_CELLS:
        why = f"the map would have {width} x {height} cells; at most {MAX_CELLS} are possible"
        raise Invalid(f"tiles: {why}", items=[ProblemItem(where="tiles", why=why)])
    return json.dumps(bounds)


def _digest(body: VersionIn, contents: dict[Place, Content]) -> str:
    """The same for the same content, however it was packed."""
    tiles = {(one.x, one.y): one.digest for one in body.tiles if one.digest is not None}
    tiles |= {place: content.digest for place, content in contents.items()}
    said = {
        "agent": body.agent,
        "note": body.note,
        "tiles": sorted((x, y, digest) for (x, y), digest in tiles.items()),
        "removed": sorted((one.x, one.y) for one in body.removed),
        "objects": None if body.objects is None else objects_json(body.objects),
    }
    return hashlib.sha256(json.dumps(said).encode()).hexdigest()
