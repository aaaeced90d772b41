"""A tag that is read and not registered is counted once per observation; registering it explains its past."""

from __future__ import annotations

from typing import Any

import httpx


async def unknown(http: httpx.AsyncClient) -> dict[str, dict[str, Any]]:
    answer = await http.get("/v1/unknown-tags")
    assert answer.status_code == 200, answer.text
    return {item["tag"]: item for item in answer.json()["items"]}


async def test_each_observation_counts_once(http: httpx.AsyncClient, post, seen) -> None:
    label = {"label": "cab/9", "kind": "cabinet", "xy": [3.0, 1.0], "tag": "T9"}
    reads = (
        seen(0, tag="T9"),
        seen(1, type="tag_observed", label="cab/0", tag="T9"),
        seen(2, type="raw_read", zone="z", tag="T9"),
        seen(3, type="inventory", labels=[label, {**label, "label": "cab/10"}]),
        seen(4, type="raw_read", zone="z", tag=None),
    )
    for _ in range(2):
        await post(*reads)
    found = (await unknown(http))["T9"]
    assert (found["count"], found["agent"], found["room"]) == (4, "cab", "lab")
    assert found["first_seen"] == "2026-05-01T10:00:00Z"
    assert found["last_seen"] == "2026-05-01T10:00:03Z"
    assert (found["label"], found["xy"]) == ("cab/10", [3.0, 1.0])


async def test_late_arrivals_keep_the_newest_place(http: httpx.AsyncClient, post, seen) -> None:
    await post(seen(5, tag="T1"))
    await post(seen(2, tag="T1"))
    found = (await unknown(http))["T1"]
    assert (found["count"], found["label"]) == (2, "cab/5")
    assert (found["first_seen"], found["last_seen"]) == ("2026-05-01T10:00:02Z", "2026-05-01T10:00:05Z")


async def test_registering_it_tells_at_once_where_it_is(http: httpx.AsyncClient, post, seen) -> None:
    await post(seen(0, type="mover_entered", label="floor/1", xy=[1.0, 2.0]), agent="floor")
    await post(seen(0, type="raw_read", zone="z", tag="T2"), seen(1, tag="T1"))
    assert set(await unknown(http)) == {"T1", "T2"}
    made = await http.put("/v1/objects/T1", json={"name": "tea", "room": "lab"})
    assert made.status_code in (200, 201), made.text
    assert set(await unknown(http)) == {"T2"}
    where = (await http.get("/v1/objects/T1/location")).json()
    assert where["best"]["label"] == "cab/1"
    assert where["best"]["p"] > 0.9
    assert where["last_direct_evidence"]["seq"] == 1
    await post(seen(3, type="tag_observed", label="cab/1", tag="T1"))
    assert set(await unknown(http)) == {"T2"}
