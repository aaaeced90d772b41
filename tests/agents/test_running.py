"""What the runners share: one state of several devices, merged inputs, an end in order."""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime

import pytest

from tms_agents.config import AgentConfig
from tms_agents.devices.transport import DeviceState
from tms_agents.running import Devices, Posted, merged, running
from tms_client import Spool
from tms_schemas.observation import RawRead

NOW = datetime(2026, 1, 1, tzinfo=UTC)


def test_the_worst_device_counts_and_says_why():
    devices = Devices()
    assert devices.sum is None
    assert devices.take("a", DeviceState("connected", "board")) == DeviceState("connected", "board")
    assert devices.take("b", DeviceState("silent", "no answer")) == DeviceState("silent", "no answer")
    assert devices.take("a", DeviceState("connected", "board again")) is None
    assert devices.take("a", DeviceState("faulty", "pulled out")).state == "faulty"
    assert devices.take("a", DeviceState("silent", "waits")).why == "waits; no answer"


async def test_merged_ends_with_the_last_and_passes_errors_on():
    closed = []

    async def count(name: str, upto: int, fails: bool = False):
        try:
            for n in range(upto):
                yield n
                await asyncio.sleep(0)
            if fails:
                raise OSError(name)
            await asyncio.sleep(0)
        finally:
            closed.append(name)

    found = [item async for item in merged({"a": count("a", 3), "b": count("b", 2)})]
    assert sorted(found) == [("a", 0), ("a", 1), ("a", 2), ("b", 0), ("b", 1)]
    assert [n for name, n in found if name == "a"] == [0, 1, 2]
    closed.clear()
    with pytest.raises(OSError, match="bad"):
        async for _ in merged({"bad": count("bad", 1, fails=True), "long": count("long", 10**9)}):
            pass
    assert sorted(closed) == ["bad", "long"]


async def test_a_slow_taker_makes_the_sources_wait():
    made = 0

    async def endless():
        nonlocal made
        while True:
            made += 1
            yield made
            await asyncio.sleep(0)

    items = merged({"a": endless()}, most_waiting=10)
    await anext(items)
    for _ in range(100):
        await asyncio.sleep(0)
    assert made <= 12
    await items.aclose()


def config(tmp_path, **spool: object) -> AgentConfig:
    server = {"url": "http://127.0.0.1:9"}
    return AgentConfig.model_validate(
        {"agent": "a", "room": "r", "server": server, "spool": {"path": tmp_path / "spool", **spool}}
    )


async def test_cancelling_ends_in_order_and_keeps_what_was_not_sent(tmp_path):
    posted, beaten = Posted(), asyncio.Event()

    async def work() -> None:
        async with running(config(tmp_path), drain_s=0.05, heartbeat_s=0.02, posted=posted) as agent:
            await agent.device("reader", NOW, DeviceState("connected", "here"))
            await agent.observations(RawRead(seq=0, observed_at=NOW, zone="z", tag="T1"))
            while agent.waiting < 4:
                await asyncio.sleep(0.01)
            beaten.set()
            await asyncio.Event().wait()

    task = asyncio.create_task(work())
    await beaten.wait()
    task.cancel()
    await task
    assert posted.observations == 2 and "does not answer" in posted.in_words()
    with Spool(tmp_path / "spool", "a") as spool:
        spool.continue_at(0)
        bodies = [item.body for item in spool.peek(100)]
    assert '"raw_read"' in bodies[1] and '"silent"' in bodies[-1]
    assert len(bodies) == posted.waiting >= 5  # with heartbeats in between


@pytest.mark.parametrize("turns", [1, 2, 3, 5, 8])
async def test_who_is_told_twice_to_end_still_says_that_he_ends(tmp_path, turns):
    """The second time may come at any moment of the end."""
    ready = asyncio.Event()

    async def work() -> None:
        async with running(config(tmp_path), drain_s=0.2, heartbeat_s=60.0) as agent:
            await agent.device("reader", NOW, DeviceState("connected", "here"))
            ready.set()
            await asyncio.Event().wait()

    task = asyncio.create_task(work())
    await ready.wait()
    task.cancel()
    for _ in range(turns):
        await asyncio.sleep(0)
    task.cancel()
    await task
    with Spool(tmp_path / "spool", "a") as spool:
        spool.continue_at(0)
        assert ['"silent"' in item.body for item in spool.peek(100)] == [False, True]


async def test_a_full_spool_is_counted_and_said_once(tmp_path, caplog):
    posted = Posted()
    async with running(config(tmp_path, max_items=1), drain_s=0, posted=posted) as agent:
        told = [await agent.observations(RawRead(seq=0, observed_at=NOW, zone="z", tag=f"T{n}")) for n in range(4)]
    assert told == [True, False, False, False] and (posted.observations, posted.lost) == (1, 3)
    assert caplog.text.count("what is seen now is lost") == 1


async def test_it_is_said_when_a_full_spool_takes_again_and_when_it_is_full_once_more(tmp_path, caplog):
    def one(n: int) -> RawRead:
        return RawRead(seq=0, observed_at=NOW, zone="z", tag=f"T{n}")

    with Spool(tmp_path / "spool", "a") as known:
        known.continue_at(0)
    posted = Posted()
    async with running(config(tmp_path, max_items=1), drain_s=0, posted=posted) as agent:
        for _ in range(2):
            assert [await agent.observations(one(n)) for n in range(3)] == [True, False, False]
            agent._poster.spool.acknowledge(agent._poster.spool.peek(9))
        assert await agent.observations(one(9))
    assert caplog.text.count("what is seen now is lost") == 2 and posted.lost == 4
    assert caplog.text.count("takes observations again; 2 were lost") == 2
