"""What a version holds as robots ask for it: the tiles that changed, the semi-dynamic objects."""

from __future__ import annotations

import json

from tms_schemas.maps import MapObject, MapObjects, Tile, TilePage
from tms_schemas.problem import ProblemItem
from tms_schemas.tiles import to_text
from tms_server.db.paging import cut, decode_cursor
from tms_server.db.tables import MapRow
from tms_server.errors import Invalid
from tms_server.maps.repository import MapRepository
from tms_server.maps.service import AnySession, find_version, whole_numbers
from tms_server.maps.tile_repository import TileRepository


async def changed_tiles(
    session: AnySession, row: MapRow, *, since: int, version: int | None, data: bool, cursor: str | None, limit: int
) -> TilePage:
    """Raises ``NotFound`` for an unknown version, ``Invalid`` for a ``since`` after it or a bad cursor."""
    found = await find_version(session, row, version)
    newest = found.version if found else 0
    if since > newest:
        why = f"version {since} is after version {newest}"
        raise Invalid(f"since: {why}", items=[ProblemItem(where="since", why=why)])
    after = whole_numbers(decode_cursor(cursor, 2))
    tiles = await TileRepository(session, row.map).changed(
        since, newest, after=None if after is None else (after[0], after[1]), limit=limit, with_data=data
    )
    page, following = cut(tiles, limit, lambda tile: (str(tile.x), str(tile.y)))
    return TilePage(
        version=newest,
        since=since,
        tiles=[
            Tile(x=one.x, y=one.y, digest=one.digest, data=None if one.body is None else to_text(one.body))
            for one in page
        ],
        next_cursor=following,
    )


async def objects_of(session: AnySession, row: MapRow, version: int | None) -> MapObjects:
    """Raises ``NotFound``."""
    found = await find_version(session, row, version)
    if found is None:
        return MapObjects(version=0, objects=[])
    text = await MapRepository(session).objects(row.map, found.version)
    return MapObjects(version=found.version, objects=[MapObject(**one) for one in json.loads(text or "[]")])
