"""A town over a database of each kind, without HTTP, and the small vocabulary that its tests are written in."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tms_schemas.rooms import RoomIn
from tms_server.clock import SystemClock
from tms_server.db.engine import create_engine
from tms_server.db.migrate import migrate
from tms_server.db.session import Sessions
from tms_server.db.tables import RoomRow
from tms_server.ingest.admission import admit
from tms_server.log.bodies import ObjectRegistered, RegistryBody, RoomChanged
from tms_server.log.record import Appended
from tms_server.log.registry import append_registry
from tms_server.settings import Settings
from tms_server.town import RoomView, Town, open_town
from tms_server.town.fold import RoomFold

SQUARE = [(0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (0.0, 6.0)]
CABINET = {
    "id": "cabinet",
    "name": "Cabinet A",
    "polygon": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "surfaces": [{"id": "shelf", "polygon": [[0, 0], [1, 0], [1, 1], [0, 1]], "z": 0.8}],
    "agent": "cab",
}
GATE = {"agent": "gate", "kind": "rfid", "zones": [{"id": "door", "polygon": [[4, 0], [8, 0], [8, 6], [4, 6]]}]}


def time(second: float) -> str:
    minutes, seconds = divmod(second, 60)
    return f"2026-05-01T10:{int(minutes):02d}:{seconds:09.6f}Z"


@dataclass
class Lab:
    """A running town and its database."""

    town: Town
    sessions: Sessions
    engine: Any

    async def room(self, room: str = "lab", tags: Sequence[str] = (), **fields: Any) -> None:
        """A room with a cabinet, a gate antenna and tracked objects."""
        body = RoomIn.model_validate(
            {"name": room, "outline": SQUARE, "furniture": [CABINET], "sensors": [GATE], **fields}
        )
        async with self.sessions.write() as session:
            session.add(RoomRow(room=room, body=body.model_dump_json(), created_at=0, updated_at=0))
            await append_registry(session, room, RoomChanged(room=body), now=SystemClock().now())
            await session.commit()
        self.town.poke(room)
        for tag in tags:
            await self.registry(ObjectRegistered(tag=tag, name=tag), room)

    async def registry(self, body: RegistryBody, room: str = "lab") -> None:
        async with self.sessions.write() as session:
            await append_registry(session, room, body, now=SystemClock().now())
            await session.commit()

    async def post(self, agent: str, *observations: dict[str, Any], room: str = "lab") -> Appended:
        body = {"agent": agent, "room": room, "observations": list(observations)}
        return await self.town.writer.submit(admit(json.dumps(body).encode()))

    async def belief(self, room: str = "lab", **when: Any) -> RoomView:
        return await self.town.belief(room, **when)

    async def sequential(self, room: str = "lab", *, until: int = 100_000) -> RoomFold:
        """The log up to an offset folded in fold order by somebody who knows nothing of actors."""
        records = [r for r in await self.town.records(room, 0, until) if not r.late and r.offset <= until]
        fold = RoomFold(Settings().budget)
        for record in sorted(records, key=lambda record: record.position):
            fold.apply(record)
        return fold


Open = Callable[..., AbstractAsyncContextManager[Lab]]


@pytest.fixture
def open_lab(database_url: str, tmp_path: Path) -> Open:
    """``async with open_lab(**settings) as lab``; again for a restart over the same database."""

    @asynccontextmanager
    async def opened(**settings: Any) -> AsyncIterator[Lab]:
        engine = create_engine(database_url)
        try:
            await migrate(engine)
            sessions = Sessions(engine)
            found = Settings(data_dir=tmp_path, database_url=database_url, **settings)
            async with open_town(engine, sessions, found, SystemClock()) as town:
                yield Lab(town, sessions, engine)
        finally:
            await engine.dispose()

    return opened


@pytest.fixture
async def lab(open_lab: Open) -> AsyncIterator[Lab]:
    async with open_lab() as found:
        yield found


@pytest.fixture
def at() -> Callable[[float], str]:
    """Seconds of the story -> RFC 3339."""
    return time
