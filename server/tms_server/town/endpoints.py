"""Queries about the belief. ``?at=`` travels in the time of observation, ``?known_at=`` in what was known when."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter, Query, Request

from tms_schemas.base import RoomId, Tag, UtcTime
from tms_schemas.belief import AnomaliesAnswer, LabelsAnswer, LocationAnswer, MoversAnswer, PlacementsAnswer
from tms_server.auth import Caller, RoomReader, require_read
from tms_server.db.session import Sessions
from tms_server.errors import NotFound
from tms_server.town import RoomView, Town
from tms_server.town.location import location, nowhere
from tms_server.town.repository import known_object

router = APIRouter(tags=["belief"])
At = Annotated[UtcTime | None, Query(description="the instant asked about (time of observation); default: newest")]
KnownAt = Annotated[UtcTime | None, Query(description="what was recorded by then; default: everything")]


@router.get("/objects/{tag}/location")
async def get_location(
    request: Request, tag: Tag, caller: Caller, at: At = None, known_at: KnownAt = None
) -> LocationAnswer:
    """Where the object probably is."""
    # The session ends before the belief is awaited: a query holds no connection while it waits for the fold.
    sessions: Sessions = request.state.sessions
    async with sessions.read() as session:
        thing = await known_object(session, tag)
    if thing is None:
        raise NotFound(f"no object has the tag {tag}")
    if thing.room is None:
        return nowhere(thing)
    require_read(caller, thing.room)
    return location(thing, await _view(request, thing.room, at, known_at))


@router.get("/rooms/{room}/placements")
async def get_placements(
    request: Request, room: RoomId, _: RoomReader, at: At = None, known_at: KnownAt = None
) -> PlacementsAnswer:
    """The whole belief: a pie per object."""
    view = await _view(request, room, at, known_at)
    return await asyncio.to_thread(view.placements)


@router.get("/rooms/{room}/labels")
async def get_labels(
    request: Request, room: RoomId, _: RoomReader, at: At = None, known_at: KnownAt = None
) -> LabelsAnswer:
    """Position labels and what they probably hold."""
    view = await _view(request, room, at, known_at)
    return await asyncio.to_thread(view.labels)


@router.get("/rooms/{room}/movers")
async def get_movers(
    request: Request, room: RoomId, _: RoomReader, at: At = None, known_at: KnownAt = None
) -> MoversAnswer:
    """Persons and robots, and how much they probably hold."""
    view = await _view(request, room, at, known_at)
    return await asyncio.to_thread(view.movers)


@router.get("/rooms/{room}/anomalies")
async def get_anomalies(
    request: Request, room: RoomId, _: RoomReader, at: At = None, known_at: KnownAt = None
) -> AnomaliesAnswer:
    """What was observed and does not fit."""
    return (await _view(request, room, at, known_at)).anomalies()


async def _view(request: Request, room: str, at: At, known_at: KnownAt) -> RoomView:
    town: Town = request.state.town
    return await town.belief(room, at, known_at)
