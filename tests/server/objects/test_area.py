"""Area search asks the belief, and registering an unknown tag makes the past count."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest

TEA = "4901234567894"


async def observe(town: httpx.AsyncClient, *observations: dict[str, Any], agent: str = "hand") -> None:
    batch = [
        {"seq": seq, "observed_at": f"2026-11-01T00:00:{seq:02}Z"} | observation
        for seq, observation in enumerate(observations)
    ]
    answer = await town.post("/v1/observations", json={"agent": agent, "room": "lab", "observations": batch})
    assert answer.status_code == 200, answer.text


@pytest.fixture
async def seen(town: httpx.AsyncClient) -> httpx.AsyncClient:
    """Three things in the lab, at x = 1, 2 and 3 m; nobody knows what the third is."""
    for tag in ("E1", "E2"):
        await town.put(f"/v1/objects/{tag}", json={"name": f"thing {tag}", "room": "lab"})
    await town.put("/v1/objects/E9", json={"name": "thing elsewhere", "room": "kitchen"})
    await observe(
        town,
        *(
            {"type": "label_appeared", "label": f"hand/{n}", "kind": "cabinet", "xy": [n, 1], "tag": f"E{n}"}
            for n in (1, 2, 3)
        ),
    )
    return town


async def find(town: httpx.AsyncClient, area: str, **query: Any) -> list[str]:
    answer = await town.get("/v1/objects", params={"room": "lab", "area": area} | query)
    assert answer.status_code == 200, answer.text
    return [item["tag"] for item in answer.json()["items"]]


async def test_objects_are_found_where_they_probably_are(seen: httpx.AsyncClient) -> None:
    assert await find(seen, "0,0,4,3") == ["E1", "E2"]
    assert await find(seen, "0.5,0.5,1.5,1.5") == ["E1"]
    assert await find(seen, "2,1,2,1") == ["E2"]  # the border belongs to it
    assert await find(seen, "3,2,4,3") == []
    assert await find(seen, "3,2,4,3", min_p=0) == ["E1", "E2"]
    assert await find(seen, "0,0,4,3", q="E2") == ["E2"]
    first = (await seen.get("/v1/objects", params={"room": "lab", "area": "0,0,4,3", "limit": 1})).json()
    assert [item["tag"] for item in first["items"]] == ["E1"]
    assert await find(seen, "0,0,4,3", cursor=first["next_cursor"]) == ["E2"]


async def test_an_unknown_tag_is_registered_from_the_list_and_the_belief_knows_at_once(
    seen: httpx.AsyncClient,
) -> None:
    listed = (await seen.get("/v1/unknown-tags")).json()["items"]
    assert [(item["tag"], item["room"], item["count"], item["xy"]) for item in listed] == [("E3", "lab", 1, [3, 1])]
    answer = await seen.post("/v1/intake", json={"tag": "E3", "jan": TEA})
    assert (answer.status_code, answer.json()["object"]["room"]) == (201, "lab")
    assert (await seen.get("/v1/unknown-tags")).json()["items"] == []
    assert await find(seen, "2.5,0.5,3.5,1.5") == ["E3"]


async def test_a_deleted_object_is_nowhere(seen: httpx.AsyncClient) -> None:
    await seen.delete("/v1/objects/E1")
    assert await find(seen, "0,0,4,3", min_p=0) == ["E2"]


async def test_where_things_are_needs_the_scope_read(
    seen: httpx.AsyncClient, make_key: Callable[..., Awaitable[str]]
) -> None:
    query = {"room": "lab", "area": "0,0,4,3"}
    observer = {"Authorization": f"Bearer {await make_key('observe:lab')}"}
    assert (await seen.get("/v1/objects", params={"room": "lab"}, headers=observer)).status_code == 200
    assert (await seen.get("/v1/objects", params=query, headers=observer)).status_code == 403
    reader = {"Authorization": f"Bearer {await make_key('read:lab')}"}
    assert (await seen.get("/v1/objects", params=query, headers=reader)).status_code == 200
