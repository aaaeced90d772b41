"""Pictures and ROS files of maps over HTTP."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import APIRouter, Response

from tms_schemas.maps import Layer, MapId, PgmMode
from tms_server.auth import Caller, require_see
from tms_server.db.session import ReadSession
from tms_server.db.tables import MapRow
from tms_server.maps import cells, pictures, service
from tms_server.maps.version_endpoints import Before, Wanted

router = APIRouter(tags=["maps"])


def _file(media_type: str, **schema: str) -> dict[str, Any]:
    return {
        "response_class": Response,
        "responses": {200: {"content": {media_type: {"schema": schema}}, "description": "the file"}},
    }


@router.get("/maps/{map}.png", **_file("image/png", type="string", format="binary"))
async def get_png(
    map: MapId, caller: Caller, session: ReadSession, version: Wanted = None, layer: Layer = "occupancy"
) -> Response:
    """A picture of a version: occupancy, or mean, variance or count of the received light intensity."""
    raster = await cells.raster(session, await _seen(session, caller, map), version)

    def draw() -> bytes:
        found = raster.cells(layer)
        return pictures.occupancy_png(found) if layer == "occupancy" else pictures.intensity_png(found)

    return Response(await asyncio.to_thread(draw), media_type="image/png")


@router.get("/maps/{map}.pgm", **_file("image/x-portable-graymap", type="string", format="binary"))
async def get_pgm(
    map: MapId, caller: Caller, session: ReadSession, version: Wanted = None, mode: PgmMode = "trinary"
) -> Response:
    """The image that `map_server` of ROS reads; take the `.yaml` of the same version and mode beside it."""
    raster = await cells.raster(session, await _seen(session, caller, map), version)
    image = await asyncio.to_thread(lambda: pictures.pgm(raster.cells(), mode))
    return Response(image, media_type="image/x-portable-graymap")


@router.get("/maps/{map}.yaml", **_file("application/yaml", type="object"))
async def get_yaml(
    map: MapId, caller: Caller, session: ReadSession, version: Wanted = None, mode: PgmMode = "trinary"
) -> Response:
    """The description that `map_server` of ROS reads. `origin` is in the map frame; it changes as the map grows."""
    row = await _seen(session, caller, map)
    found = await service.find_version(session, row, version)
    text = pictures.yaml(service.town_map(row), found.version if found else 0, service.bounds_of(found), mode)
    return Response(text, media_type="application/yaml")


@router.get("/maps/{map}/diff.png", **_file("image/png", type="string", format="binary"))
async def get_diff_png(
    map: MapId, caller: Caller, session: ReadSession, before: Before, after: Wanted = None
) -> Response:
    """What changed: red became occupied, blue became free, yellow became known, violet became unknown."""
    row = await _seen(session, caller, map)
    old, new = await cells.raster(session, row, before), await cells.raster(session, row, after)
    return Response(await asyncio.to_thread(pictures.diff_png, old, new), media_type="image/png")


async def _seen(session: ReadSession, caller: Caller, map: str) -> MapRow:
    row = await service.find(session, map)
    require_see(caller, row.room)
    return row
