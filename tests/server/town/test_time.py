"""Travel in the time of observation (at) and in what was known when (known_at); what comes too late, or too early."""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

START = datetime(2026, 5, 1, 10, tzinfo=UTC)
WALK: dict[str, Any] = {"type": "label_moved", "label": "floor/0"}


async def walk(lab: Any, at: Any, seqs: Any) -> None:
    for seq in seqs:
        event = {**WALK, "xy": [seq / 10, 1]} if seq else {"type": "mover_entered", "label": "floor/0", "xy": [0, 1]}
        await lab.post("floor", {"seq": seq, "observed_at": at(seq), **event})


async def where(lab: Any, **when: Any) -> float | None:
    movers = (await lab.belief(**when)).movers().movers
    return movers[0].xy[0] if movers else None


async def test_the_room_as_it_was(open_lab, at) -> None:
    for snapshot_every in (5, 10_000):
        async with open_lab(snapshot_every=snapshot_every) as lab:
            if snapshot_every == 5:
                await lab.room(tags=["E1"])
                await walk(lab, at, range(60))
            for second in (0, 3, 17, 59):
                assert await where(lab, at=START + timedelta(seconds=second + 0.5)) == second / 10
            assert await where(lab, at=START - timedelta(seconds=1)) is None
            view = await lab.belief(at=START + timedelta(seconds=17))
            assert (view.at, view.cursor) == (START + timedelta(seconds=17), 62)
            assert view.labels().labels == []
            assert not view.movers().movers[0].stale
            assert (await lab.belief()).movers().movers[0].stale


async def test_what_was_known_when(lab, at) -> None:
    await lab.room()
    await walk(lab, at, (0, 1, 3))
    await asyncio.sleep(0.02)
    then = datetime.now(UTC)
    await asyncio.sleep(0.02)
    await walk(lab, at, (2, 4))
    assert await where(lab) == 0.4
    assert await where(lab, known_at=then) == 0.3
    assert await where(lab, known_at=then, at=START + timedelta(seconds=2.5)) == 0.1
    assert await where(lab, at=START + timedelta(seconds=2.5)) == 0.2


async def test_what_comes_after_the_retention_is_kept_and_flagged(open_lab, at) -> None:
    async with open_lab(retention_s=10) as lab:
        await lab.room()
        await walk(lab, at, (0, 30))
        answer = await lab.post(
            "floor",
            {"seq": 1, "observed_at": at(19), **WALK, "xy": [1, 1]},
            {"seq": 2, "observed_at": at(21), **WALK, "xy": [2, 1]},
        )
        assert (answer.accepted, answer.too_late) == (2, [1])
        assert [record.late for record in await lab.town.records("lab", 0, 10)] == [False] * 3 + [True, False]
        view = await lab.belief()
        assert view.cursor == 5
        assert view.fold.to_bytes() == (await lab.sequential()).to_bytes()
    async with open_lab(retention_s=10) as lab:
        assert (await lab.belief()).fold.to_bytes() == view.fold.to_bytes()


async def test_a_stamp_in_the_future_is_folded_in_its_place(lab, at) -> None:
    await lab.room()
    await walk(lab, at, (0,))
    await lab.post("floor", {"seq": 9, "observed_at": "2999-01-01T00:00:00Z", **WALK, "xy": [7, 1]})
    await walk(lab, at, (1,))
    assert await where(lab) == 7.0
    assert await where(lab, at=START + timedelta(seconds=5)) == 0.1


async def test_a_subscriber_is_told_of_every_last_change(lab, at) -> None:
    await lab.room()
    seen = []
    async with lab.town.subscribe("lab") as changes:
        async with asyncio.timeout(20):
            posting = asyncio.create_task(walk(lab, at, range(30)))
            async for head in changes:
                seen.append(head)
                if head == 31:
                    break
            await posting
    assert seen == sorted(seen)
    assert seen[-1] == 31


@pytest.mark.parametrize("path", ["placements", "labels", "movers", "anomalies"])
async def test_answers_over_http(http, path: str) -> None:
    await http.put("/v1/rooms/lab", json={"name": "Lab", "outline": [[0, 0], [1, 0], [1, 1]]})
    answer = await http.get(f"/v1/rooms/lab/{path}", params={"at": "2026-05-01T10:00:00Z"})
    assert (answer.status_code, answer.json()["room"], answer.json()["cursor"]) == (200, "lab", 1)
    assert (await http.get(f"/v1/rooms/attic/{path}")).status_code == 404
    assert (await http.get(f"/v1/rooms/lab/{path}", params={"at": "yesterday"})).status_code == 422


async def test_location_over_http(http) -> None:
    await http.put("/v1/rooms/lab", json={"name": "Lab", "outline": [[0, 0], [9, 0], [9, 9]]})
    await http.put("/v1/objects/E1", json={"name": "tea", "room": "lab"})
    await http.put("/v1/objects/E2", json={"name": "umbrella"})
    label = {"label": "cab/1", "kind": "cabinet", "xy": [1, 1], "tag": "E1"}
    told = {"seq": 0, "observed_at": "2026-05-01T10:00:00Z", "type": "inventory", "labels": [label]}
    await http.post("/v1/observations", json={"agent": "cab", "room": "lab", "observations": [told]})
    tea = (await http.get("/v1/objects/e1/location")).json()
    assert (tea["name"], tea["best"]["label"], tea["best"]["xy"]) == ("tea", "cab/1", [1.0, 1.0])
    assert sum(slice["p"] for slice in tea["distribution"]) == pytest.approx(1)
    assert (tea["last_direct_evidence"]["type"], tea["staleness_s"]) == ("inventory", 0.0)
    early = (await http.get("/v1/objects/E1/location", params={"at": "2026-05-01T09:00:00Z"})).json()
    assert early["distribution"][0]["label"] == "OUT"
    nowhere = (await http.get("/v1/objects/E2/location")).json()
    assert (nowhere["rooms"], [slice["label"] for slice in nowhere["distribution"]]) == ([], ["OUT"])
    assert (await http.get("/v1/objects/E3/location")).status_code == 404
