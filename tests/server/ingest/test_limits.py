"""What cannot be held is refused with a time to come back, never dropped; what was acknowledged is in the log."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import text

from tms_schemas.observation import AgentState
from tms_server.errors import TmsError, TooManyRequests, Unavailable
from tms_server.ingest.writer import GroupWriter
from tms_server.log.record import Appended, Batch
from tms_server.settings import Settings

STATE = AgentState(seq=0, observed_at=datetime.fromtimestamp(0, UTC), state="connected")


class SlowLog:
    """A room log that waits for ``go`` before it is durable, and may fail."""

    def __init__(self) -> None:
        self.go = asyncio.Event()
        self.groups: list[int] = []
        self.failure: TmsError | None = None

    async def append(self, batches: Sequence[Batch]) -> list[Appended]:
        await self.go.wait()
        self.groups.append(len(batches))
        if self.failure is not None:
            raise self.failure
        return [Appended(len(batch.observations), 0, 1, []) for batch in batches]


def batch(agent: str, size: int) -> Batch:
    return Batch(agent, "lab", [STATE] * size, list(range(size)), 0, 0, [], [], "{}")


@pytest.fixture
async def slow(tmp_path: Path) -> Any:
    log = SlowLog()
    settings = Settings(data_dir=tmp_path, queue_observations=100, queue_per_agent=40, fold_backlog=5)
    backlog: dict[str, int] = {}
    writer = GroupWriter(log, settings, lambda room: backlog.get(room, 0))  # type: ignore[arg-type]
    running = asyncio.create_task(writer.run())
    yield log, writer, backlog
    log.go.set()
    writer.close()
    await running


async def test_queues_are_bounded(slow: Any) -> None:
    log, writer, _ = slow
    held = [asyncio.create_task(writer.submit(batch(agent, 30))) for agent in ("a", "b", "c")]
    await asyncio.sleep(0)
    with pytest.raises(TooManyRequests) as many:
        await writer.submit(batch("a", 11))
    with pytest.raises(Unavailable) as full:
        await writer.submit(batch("d", 11))
    assert many.value.retry_after_s and full.value.retry_after_s
    log.go.set()
    assert [appended.accepted for appended in await asyncio.gather(*held)] == [30, 30, 30]
    assert (await writer.submit(batch("a", 11))).accepted == 11
    assert (await writer.submit(batch("a", 1000))).accepted == 1000


async def test_what_waits_together_is_written_together(slow: Any) -> None:
    log, writer, _ = slow
    held = [asyncio.create_task(writer.submit(batch(f"a{n}", 1))) for n in range(50)]
    await asyncio.sleep(0)
    held[7].cancel()
    log.go.set()
    await asyncio.gather(*held, return_exceptions=True)
    assert len(log.groups) <= 2


async def test_a_belief_far_behind_refuses(slow: Any) -> None:
    log, writer, backlog = slow
    log.go.set()
    backlog["lab"] = 6
    with pytest.raises(Unavailable, match="behind"):
        await writer.submit(batch("a", 1))
    backlog["lab"] = 5
    assert (await writer.submit(batch("a", 1))).accepted == 1


async def test_a_failing_log_refuses_each_and_the_writer_lives(slow: Any) -> None:
    log, writer, _ = slow
    log.failure = Unavailable("the disk is full", retry_after_s=2)
    log.go.set()
    answers = await asyncio.gather(*(writer.submit(batch(f"a{n}", 1)) for n in range(3)), return_exceptions=True)
    assert [type(answer) for answer in answers] == [Unavailable] * 3
    log.failure = None
    assert (await writer.submit(batch("a", 1))).accepted == 1


async def test_a_log_that_fails_for_long_does_not_fill_the_disk_with_saying_so(slow: Any, caplog: Any) -> None:
    log, writer, _ = slow
    log.go.set()
    for n in range(2):
        log.failure = Unavailable("the log cannot be written: database or disk is full", retry_after_s=2)
        for _ in range(50):
            with pytest.raises(Unavailable, match="disk is full"):
                await writer.submit(batch("a", 1))
        log.failure = None
        await writer.submit(batch("a", 1))
        assert caplog.text.count("batches refused: the log cannot be written: database or disk is full") == n + 1
        assert caplog.text.count("written again; 50 batches were refused") == n + 1


async def test_after_the_end_nothing_is_taken(slow: Any) -> None:
    log, writer, _ = slow
    waiting = asyncio.create_task(writer.submit(batch("a", 3)))
    await asyncio.sleep(0)
    writer.close()
    with pytest.raises(Unavailable, match="shutting down"):
        await writer.submit(batch("b", 1))
    log.go.set()
    assert (await waiting).accepted == 3


async def test_a_database_that_fails_is_503_and_recovers(
    http: httpx.AsyncClient, sessions: Any, post: Any, seen: Any
) -> None:
    await post(seen(0))
    await http.get("/v1/rooms/lab/placements")
    await _rename(sessions, "agents", "gone")
    failed = await post(seen(1))
    assert failed.status_code == 503
    assert int(failed.headers["retry-after"]) >= 1
    await _rename(sessions, "gone", "agents")
    assert (await post(seen(1))).json() == {"accepted": 1, "duplicates": 0, "head": 3, "too_late": []}
    assert (await http.get("/v1/rooms/lab/placements")).json()["cursor"] == 3


async def test_a_lost_connection_is_503_and_recovers(
    http: httpx.AsyncClient, database_url: str, sessions: Any, post: Any, seen: Any
) -> None:
    if not database_url.startswith("postgresql"):
        return  # an embedded database has no connection to lose
    await post(seen(0))
    async with sessions.write() as session:
        # All but the one that holds the lock on the database: losing that one ends the server's ownership.
        cut = (
            "select pg_terminate_backend(pid) from pg_stat_activity where pid <> pg_backend_pid()"
            " and datname = current_database() and query not like '%advisory%'"
        )
        await session.execute(text(cut))
    answers = [(await post(seen(1))).status_code for _ in range(3)]
    assert set(answers) <= {200, 503}
    assert answers[-1] == 200
    assert (await post(seen(1))).json()["duplicates"] == 1
    assert (await http.get("/v1/rooms/lab/placements")).json()["cursor"] == 3


async def _rename(sessions: Any, old: str, new: str) -> None:
    async with sessions.write() as session:
        await session.execute(text(f"alter table {old} rename to {new}"))
        await session.commit()
