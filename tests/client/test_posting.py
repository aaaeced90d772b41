"""Posting from the spool: order, dead letters, batches that are too large, lost spools, servers that come and go."""

from __future__ import annotations

import asyncio
import random
import threading
from datetime import UTC, datetime

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tms_client import AsyncTown, Pace, Retry, Spool, Town, Unreachable
from tms_schemas.observation import RawRead

QUICK = Retry(first_s=0.01, cap_s=0.05, random=random.Random(1))


def read(tag: str) -> RawRead:
    return RawRead(seq=0, observed_at=datetime(2026, 1, 1, tzinfo=UTC), zone="z", tag=tag)


def tags(items) -> list[str]:
    return [item["tag"] for item in items]


@pytest.fixture
def spool(tmp_path):
    with Spool(tmp_path / "spool", "a") as spool:
        yield spool


@pytest.fixture
def town(fake):
    with Town(fake.url) as town:
        yield town


def test_drains_in_order_in_batches(fake, town, spool):
    poster = town.poster(spool, "r", pace=Pace(batch=50))
    poster.post(*(read(f"T{n}") for n in range(120)))
    assert poster.drain()
    assert tags(fake.received("a")) == [f"T{n}" for n in range(120)]
    assert [item["seq"] for item in fake.received("a")] == list(range(120))
    assert sum(path == "/v1/observations" for _, path, _, _ in fake.requests) == 3
    assert len(spool) == 0


@given(bad=st.sets(st.integers(0, 29)), names=st.booleans(), most=st.integers(1, 40), batch=st.integers(1, 40))
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_bad_items_never_block_the_others(fake, town, tmp_path_factory, bad, names, most, batch):
    """Whichever items the server refuses, named or not, however small its bodies: the rest arrives in order."""
    fake.records.clear()
    fake.refuse = lambda item: "no such tag" if int(item["tag"][1:]) in bad else None
    fake.names_items, fake.most_items = names, most
    with Spool(tmp_path_factory.mktemp("spool") / "s", "a") as spool:
        poster = town.poster(spool, "r", pace=Pace(batch=batch))
        poster.post(*(read(f"T{n}") for n in range(30)))
        assert poster.drain()
        assert tags(fake.received("a")) == [f"T{n}" for n in range(30) if n not in bad]
        assert [dead.seq for dead in spool.dead_letters()] == sorted(bad) and spool.buried == len(bad)
        if names and bad:
            assert "no such tag" in spool.dead_letters()[0].reason


def test_a_number_the_server_holds_with_another_body_is_a_dead_letter(fake, town, spool):
    spool.continue_at(0)
    fake.records[("a", 1)] = {"seq": 1, "other": True}
    poster = town.poster(spool, "r")
    poster.post(read("A"), read("B"), read("C"))
    assert poster.drain()
    assert tags(item for item in fake.received("a") if "tag" in item) == ["A", "C"]
    assert [dead.seq for dead in spool.dead_letters()] == [1]


def test_that_another_agent_has_the_name_is_said_once(fake, town, spool, caplog):
    poster = town.poster(spool, "r", pace=Pace(batch=1))
    spool.continue_at(0)
    fake.records |= {("a", n): {"of": "another agent"} for n in range(2)}
    poster.post(read("A"), read("B"), read("C"))
    assert poster.drain()
    said = [one.getMessage() for one in caplog.records if one.levelname == "ERROR"]
    assert len(said) == 1 and "does another agent run under this name?" in said[0]
    assert len(spool.dead_letters()) == 2 and tags([fake.records["a", 2]]) == ["C"]


def test_a_lost_spool_continues_where_the_server_stands(fake, town, tmp_path):
    for n in range(2):
        with Spool(tmp_path / f"spool{n}", "a") as spool:
            poster = town.poster(spool, "r")
            poster.post(read("A"), read("B"))
            assert poster.drain()
            label = spool.new_label()
    assert [(item["seq"], item["tag"]) for item in fake.received("a")] == [(0, "A"), (1, "B"), (2, "A"), (3, "B")]
    assert label == f"a/{int(fake.first_label.timestamp() * 1000) + 1}"


def test_an_answer_that_was_lost_is_a_duplicate(fake, town, spool):
    """The server took the batch, the connection broke: sending it again stores nothing twice."""
    poster = town.poster(spool, "r", retry=QUICK)
    spool.continue_at(0)
    poster.post(read("A"))
    item = spool.peek(1)[0]
    fake.records[("a", 0)] = {
        "seq": 0,
        "type": "raw_read",
        "zone": "z",
        "tag": "A",
        "observed_at": "2026-01-01T00:00:00Z",
    }
    assert item.seq == 0 and poster.drain()
    assert len(fake.received("a")) == 1 and spool.buried == 0


def test_a_wrong_room_is_not_blamed_on_the_observations(fake, town, spool):
    spool.continue_at(0)
    poster = town.poster(spool, "r", pace=Pace(refused_s=0.01))
    poster.post(read("A"))
    problem = {"title": "Invalid", "status": 422, "items": [{"where": "/room", "why": "bad name"}]}
    fake.script += [(404, {}, {"title": "Not found", "status": 404}), (422, {}, problem)]
    assert poster.drain()
    assert tags(fake.received("a")) == ["A"] and spool.buried == 0


def test_a_revoked_key_keeps_everything(fake, town, spool):
    poster = town.poster(spool, "r", pace=Pace(refused_s=0.01))
    poster.post(read("A"))
    fake.script += [(401, {}, {"title": "Unauthorized", "status": 401})] * 3
    assert poster.drain()
    assert tags(fake.received("a")) == ["A"]


def test_background_thread(fake, town, spool):
    with town.poster(spool, "r", pace=Pace(linger_s=0.01)) as poster:
        for n in range(20):
            poster.post(read(f"T{n}"))
        assert poster.drain()
    assert tags(fake.received("a")) == [f"T{n}" for n in range(20)]


async def test_background_task_outlives_a_busy_server(fake, spool):
    fake.script += [(503, {"retry-after": "0.1"}, ""), (429, {}, ""), (502, {}, "")]
    pace = Pace(linger_s=0.01)
    async with AsyncTown(fake.url) as town, town.poster(spool, "r", pace=pace, retry=QUICK) as poster:
        await asyncio.gather(*(poster.post(read(f"T{n}")) for n in range(20)))
        assert await poster.drain()
        assert poster.trouble is None
    assert len(fake.received("a")) == 20


async def test_no_server_no_loss(tmp_path, fake):
    """Nothing listens: the spool keeps all; with a server it empties."""
    with Spool(tmp_path / "s", "a") as spool:
        async with AsyncTown("http://127.0.0.1:9") as town, town.poster(spool, "r", retry=QUICK) as poster:
            await poster.post(read("A"))
            assert not await poster.drain(0.2)
            assert isinstance(poster.trouble, Unreachable)
        assert len(spool) == 1
        async with AsyncTown(fake.url) as town:
            assert await town.poster(spool, "r").drain()
    assert tags(fake.received("a")) == ["A"]


def test_a_drain_ends_in_time_while_the_thread_keeps_trying(tmp_path):
    with Spool(tmp_path / "s", "a") as spool, Town("http://127.0.0.1:9") as town, town.poster(spool, "r") as poster:
        poster.post(read("A"))
        answers: list[bool] = []
        asking = threading.Thread(target=lambda: answers.append(poster.drain(0.2)), daemon=True)
        asking.start()
        asking.join(20)
        assert answers == [False] and len(spool) == 1
