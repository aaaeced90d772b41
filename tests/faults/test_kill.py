"""Kill -9 at random moments while ten agents post: nothing acknowledged is lost or doubled, the belief is the log's."""

from __future__ import annotations

import asyncio
import os
import random
import socket
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import pytest
from server_process import ServerProcess

from tms_server.clock import SystemClock
from tms_server.db.engine import create_engine
from tms_server.log.record import Record
from tms_server.log.sql import SqlRoomLog
from tms_server.settings import Settings
from tms_server.town.actor import Frozen
from tms_server.town.fold import RoomFold
from tms_server.town.views import RoomView

KILLS = int(os.environ.get("TMS_KILLS", "6"))
AGENTS = 10
TAGS = [f"E{n}" for n in range(6)]
ROOM = {"name": "Lab", "outline": [[0, 0], [8, 0], [8, 6], [0, 6]], "seed": 5}


class Agent:
    """Posts what it sees, and posts it again until the server says that it has it."""

    def __init__(self, name: str, url: str) -> None:
        self._name, self._url, self._random = name, url, random.Random(name)
        self._next, self._labels = 0, [f"{name}/mover"]
        self.acknowledged: list[int] = []
        self.duplicates = 0

    async def run(self, stop: asyncio.Event) -> None:
        async with httpx.AsyncClient(base_url=self._url, timeout=20) as http:
            while not stop.is_set():
                batch = [self._observe() for _ in range(self._random.randint(1, 20))]
                await self._deliver(http, batch)
                await asyncio.sleep(self._random.random() * 0.05)

    async def _deliver(self, http: httpx.AsyncClient, batch: list[dict[str, Any]]) -> None:
        body = {"agent": self._name, "room": "lab", "observations": batch}
        while True:
            try:
                answer = await http.post("/v1/observations", json=body)
            except httpx.TransportError:
                await asyncio.sleep(0.05)
                continue
            if answer.status_code == 503:
                await asyncio.sleep(0.2)
                continue
            assert answer.status_code == 200, answer.text
            assert answer.json()["accepted"] + answer.json()["duplicates"] == len(batch)
            self.duplicates += answer.json()["duplicates"]
            self.acknowledged += [observation["seq"] for observation in batch]
            return

    def _observe(self) -> dict[str, Any]:
        seq, pick, xy = self._next, self._random.random(), [self._random.uniform(0, 8), self._random.uniform(0, 6)]
        self._next += 1
        event: dict[str, Any]
        if seq == 0:
            event = {"type": "mover_entered", "label": self._labels[0], "xy": xy}
        elif pick < 0.6 or len(self._labels) > 4:
            event = {"type": "label_moved", "label": self._labels[0], "xy": xy}
            if pick > 0.8:
                event = {"type": "label_vanished", "label": self._labels.pop()}
        elif pick < 0.8:
            self._labels.append(f"{self._name}/{seq}")
            tag = self._random.choice([*TAGS, None, "X1"])
            event = {"type": "label_appeared", "label": self._labels[-1], "kind": "floor", "xy": xy, "tag": tag}
        else:
            event = {"type": "handover_possible", "a": self._labels[0], "b": {"xy": xy}}
        return {"seq": seq, "observed_at": datetime.now(UTC).isoformat(), **event}


@pytest.mark.timeout(1700)
async def test_kill_9_loses_and_doubles_nothing(database_url: str, tmp_path: Path) -> None:
    port = _free_port()
    server = ServerProcess(tmp_path, database_url, port=port, TMS_SNAPSHOT_EVERY="200", TMS_SILENT_AFTER_S="1e6")
    await _start(server)
    try:
        await _furnish(server.url)
        agents = [Agent(f"agent{n}", server.url) for n in range(AGENTS)]
        stop = asyncio.Event()
        posting = [asyncio.create_task(agent.run(stop)) for agent in agents]
        moments = random.Random(KILLS)
        for _ in range(KILLS):
            await asyncio.sleep(moments.uniform(0.05, 1.0))
            await asyncio.to_thread(server.kill)
            await _start(server)
        await asyncio.sleep(0.5)
        stop.set()
        await asyncio.gather(*posting)

        async with httpx.AsyncClient(base_url=server.url, timeout=60) as http:
            answer = (await http.get("/v1/rooms/lab/placements")).json()
            unknown = (await http.get("/v1/unknown-tags")).json()["items"]
    finally:
        server.stop()

    records = await _log_of(database_url)
    assert [record.offset for record in records] == list(range(1, len(records) + 1))
    recorded = Counter((record.agent, record.seq) for record in records)
    assert set(recorded.values()) == {1}
    acknowledged = {(agent._name, seq) for agent in agents for seq in agent.acknowledged}
    assert len(acknowledged) > 10 * KILLS
    assert acknowledged <= set(recorded)
    assert answer["cursor"] == len(records)
    assert answer["objects"] == _sequential(records)["objects"]
    reads = sum(getattr(record.content, "tag", None) == "X1" for record in records)
    assert [item["count"] for item in unknown] == [reads]
    print(f"{KILLS} kills, {len(acknowledged)} acknowledged, {sum(a.duplicates for a in agents)} sent again")


def _sequential(records: list[Record]) -> dict[str, Any]:
    fold = RoomFold(Settings().budget)
    for record in sorted(records, key=lambda record: record.position):
        fold.apply(record)
    view = RoomView(
        room="lab",
        frozen=Frozen(fold, len(records), {}),
        asked=None,
        now=datetime.now(UTC),
        silent_after_s=1e6,
        patience_s=5,
    )
    return view.placements().model_dump(mode="json")


async def _log_of(database_url: str) -> list[Record]:
    engine = create_engine(database_url)
    log = SqlRoomLog(engine, SystemClock(), retention_s=None)
    try:
        return await log.read("lab", 0, 1_000_000)
    finally:
        await log.close()
        await engine.dispose()


async def _furnish(url: str) -> None:
    async with httpx.AsyncClient(base_url=url, timeout=30) as http:
        assert (await http.put("/v1/rooms/lab", json=ROOM)).is_success
        for tag in TAGS:
            assert (await http.put(f"/v1/objects/{tag}", json={"name": tag, "room": "lab"})).is_success


async def _start(server: ServerProcess) -> None:
    """PostgreSQL may need a moment to notice that the former owner of the database is dead."""
    for attempt in range(20):
        try:
            await asyncio.to_thread(server.start)
            return
        except RuntimeError:
            if attempt == 19:
                raise
            await asyncio.sleep(0.2)


def _free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port: int = found.getsockname()[1]
        return port
