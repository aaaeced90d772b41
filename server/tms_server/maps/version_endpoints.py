"""Versions of maps over HTTP: their tiles as robots send and follow them, objects, differences."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response

from tms_schemas.maps import (
    MapDiff,
    MapId,
    MapObjects,
    MapVersion,
    TilePage,
    TilesKept,
    TileUpload,
    VersionIn,
    VersionPage,
)
from tms_server.auth import Caller, require_observe, require_see
from tms_server.db.paging import Cursor, Limit
from tms_server.db.session import ReadSession, Session
from tms_server.errors import NotFound
from tms_server.maps import differences, reading, service, versions

router = APIRouter(tags=["maps"])

Wanted = Annotated[int | None, Query(ge=0, lt=2**31, description="a version; the newest by default")]
Since = Annotated[int, Query(ge=0, lt=2**31, description="the version that the caller has, 0 for none")]
Before = Annotated[int, Query(ge=0, lt=2**31, description="a version; 0 is the empty map")]

LeastM = Annotated[float, Query(ge=0, le=1e6, description="an object that moved less (m) has not moved")]
LeastRad = Annotated[float, Query(ge=0, le=4, description="an object that turned less (rad) has not turned")]


@router.get("/maps/{map}/versions")
async def list_versions(
    map: MapId, caller: Caller, session: ReadSession, limit: Limit = 100, cursor: Cursor = None
) -> VersionPage:
    """Who made them and when, the newest first."""
    row = await service.find(session, map)
    require_see(caller, row.room)
    return await service.list_versions(session, map, cursor=cursor, limit=limit)


@router.get("/maps/{map}/versions/{version}")
async def get_version(
    map: MapId, version: Annotated[int, Path(ge=0, lt=2**31)], caller: Caller, session: ReadSession
) -> MapVersion:
    row = await service.find(session, map)
    require_see(caller, row.room)
    found = await service.find_version(session, row, version)
    if found is None:
        raise NotFound("version 0 is the empty map before the first")
    return service.map_version(found)


@router.post("/maps/{map}/versions", responses={201: {"model": MapVersion, "description": "a new version"}})
async def post_version(
    map: MapId, body: VersionIn, caller: Caller, session: Session, request: Request, response: Response
) -> MapVersion:
    """The tiles that changed since `base`, which must be the newest version (else 409): visible wholly or not at all.

    200 with the version there is where nothing changed, or where this very request made it before.
    """
    contents = await asyncio.to_thread(versions.read_version, body)
    require_observe(caller, (await service.find(session, map)).room)
    answer, created = await versions.post_version(session, request.state.clock, map, body, contents)
    response.status_code = 201 if created else 200
    return answer


@router.post("/maps/{map}/tiles")
async def post_tiles(map: MapId, body: TileUpload, caller: Caller, session: Session, request: Request) -> TilesKept:
    """Tiles ahead of the version that will name them by digest, where they are too many for one request.

    Kept for an hour.
    """
    contents = await asyncio.to_thread(versions.read_upload, body)
    require_observe(caller, (await service.find(session, map)).room)
    return await versions.keep_tiles(session, request.state.clock, map, contents)


@router.get("/maps/{map}/tiles")
async def changed_tiles(
    map: MapId,
    caller: Caller,
    session: ReadSession,
    since: Since = 0,
    version: Wanted = None,
    data: Annotated[bool, Query(description="false: digests only")] = True,
    limit: Limit = 200,
    cursor: Cursor = None,
) -> TilePage:
    """The tiles in which a version differs from the one that the caller has."""
    row = await service.find(session, map)
    require_see(caller, row.room)
    return await reading.changed_tiles(
        session, row, since=since, version=version, data=data, cursor=cursor, limit=limit
    )


@router.get("/maps/{map}/objects")
async def get_objects(map: MapId, caller: Caller, session: ReadSession, version: Wanted = None) -> MapObjects:
    """The semi-dynamic objects (doors, bins, cabinets on wheels) as a version has them."""
    row = await service.find(session, map)
    require_see(caller, row.room)
    return await reading.objects_of(session, row, version)


@router.get("/maps/{map}/diff")
async def get_diff(
    map: MapId,
    caller: Caller,
    session: ReadSession,
    before: Before,
    after: Wanted = None,
    least_m: LeastM = 0.0,
    least_rad: LeastRad = 0.0,
) -> MapDiff:
    """Which tiles changed from one version to another, how many cells became what, which objects moved."""
    row = await service.find(session, map)
    require_see(caller, row.room)
    found = await differences.pair(session, row, before, after, differences.Least(least_m, least_rad))
    return await asyncio.to_thread(found.counts)
