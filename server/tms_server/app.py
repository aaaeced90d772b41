"""The application factory: everything a request needs hangs on the lifespan's typed state, nothing is global."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TypedDict

from fastapi import FastAPI
from sqlalchemy.ext.asyncio import AsyncEngine

from tms_server import apidocs, health, problems
from tms_server.agents.disputes import Disputes
from tms_server.agents.endpoints import router as agents_router
from tms_server.clock import Clock, SystemClock
from tms_server.db.engine import create_engine
from tms_server.db.lock import own_database
from tms_server.db.migrate import migrate
from tms_server.db.session import Sessions
from tms_server.ingest.endpoints import router as ingest_router
from tms_server.keys.endpoints import router as keys_router
from tms_server.keys.ring import KeyRing
from tms_server.limits import BodyLimit
from tms_server.live.endpoints import router as live_router
from tms_server.live.feed import Feeds
from tms_server.maps.endpoints import router as maps_router
from tms_server.objects.endpoints import router as objects_router
from tms_server.placement import warm_up
from tms_server.rooms.endpoints import router as rooms_router
from tms_server.settings import Settings
from tms_server.town import Town, open_town
from tms_server.town.endpoints import router as town_router
from tms_server.web import install_page


class State(TypedDict):
    """What requests find at ``request.state``."""

    settings: Settings
    clock: Clock
    engine: AsyncEngine
    sessions: Sessions
    keys: KeyRing
    town: Town
    feeds: Feeds
    disputes: Disputes


def create_app(settings: Settings, *, clock: Clock | None = None) -> FastAPI:
    """A server over one database. Raises ``DatabaseOwned`` at start-up where another process has it."""
    clock = clock or SystemClock()

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[State]:
        settings.data_dir.mkdir(parents=True, exist_ok=True)
        engine = create_engine(settings.url())
        try:
            async with own_database(engine):
                await migrate(engine)
                await asyncio.to_thread(warm_up, _say)
                sessions = Sessions(engine)
                async with open_town(engine, sessions, settings, clock) as town:
                    yield State(
                        settings=settings,
                        clock=clock,
                        engine=engine,
                        sessions=sessions,
                        keys=KeyRing(sessions),
                        town=town,
                        feeds=Feeds(town),
                        disputes=Disputes(),
                    )
        finally:
            await engine.dispose()

    app = FastAPI(title="Town Management System", version="1", lifespan=lifespan, docs_url=None, redoc_url=None)
    app.add_middleware(BodyLimit, limit=settings.max_body_bytes)
    problems.install(app)
    # Routes are tried in order: the busiest first.
    for router in (
        ingest_router,
        keys_router,
        objects_router,
        rooms_router,
        town_router,
        agents_router,
        maps_router,
    ):
        app.include_router(router, prefix="/v1", responses=problems.COMMON_RESPONSES)
    app.include_router(live_router, prefix="/v1")
    app.include_router(health.router)
    apidocs.install(app)
    install_page(app)
    return app


def _say(message: str) -> None:
    """For the person who waits for the first start."""
    sys.stderr.write(f"tms: {message}\n")
    sys.stderr.flush()
