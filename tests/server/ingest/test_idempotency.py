"""(agent, seq) names an observation for ever: the same one again is a duplicate, another one a conflict."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx
import pytest


async def test_what_is_sent_again_is_counted_and_not_recorded(http: httpx.AsyncClient, post, seen) -> None:
    first = (await post(seen(0), seen(1))).json()
    again = (await post(seen(1), seen(2), seen(0))).json()
    assert (first["accepted"], first["duplicates"]) == (2, 0)
    assert (again["accepted"], again["duplicates"]) == (1, 2)
    assert again["head"] == first["head"] + 1
    agent = (await http.get("/v1/agents/cab")).json()
    assert (agent["next_seq"], agent["missing"], agent["state"]) == (3, 0, "connected")


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"xy": [1, 2]}, {"xy": [1.0, 2.0]}),
        ({"observed_at": "2026-05-01T19:00:00+09:00"}, {"observed_at": "2026-05-01T10:00:00Z"}),
        ({"tag": "e004"}, {"tag": "E004"}),
    ],
)
async def test_another_spelling_is_the_same_observation(post, seen, one: dict[str, Any], other: dict[str, Any]) -> None:
    await post({**seen(0), **one})
    answer = (await post({**seen(0), **other})).json()
    assert answer["duplicates"] == 1


@pytest.mark.parametrize("other", [{"xy": [1, 3]}, {"tag": None}, {"observed_at": "2026-05-01T10:00:00.000001Z"}])
async def test_another_body_is_a_conflict_and_nothing_is_recorded(
    http: httpx.AsyncClient, post, seen, other: dict[str, Any]
) -> None:
    head = (await post(seen(0), seen(1))).json()["head"]
    answer = await post(seen(2), {**seen(1), **other})
    assert answer.status_code == 409
    assert answer.headers["content-type"].startswith("application/problem+json")
    assert [(item["index"], item["seq"]) for item in answer.json()["items"]] == [(1, 1)]
    assert (await post(seen(2))).json() == {"accepted": 1, "duplicates": 0, "head": head + 1, "too_late": []}


async def test_a_number_twice_in_one_batch(post, seen) -> None:
    twice = (await post(seen(0), seen(0))).json()
    assert (twice["accepted"], twice["duplicates"]) == (1, 1)
    conflict = await post(seen(1), {**seen(1), "xy": [5, 5]})
    assert conflict.status_code == 409
    assert [item["index"] for item in conflict.json()["items"]] == [1]


async def test_the_same_observation_in_another_room_is_a_conflict(http: httpx.AsyncClient, post, seen) -> None:
    await http.put("/v1/rooms/attic", json={"name": "Attic", "outline": [[0, 0], [1, 0], [1, 1]]})
    await post(seen(0))
    assert (await post(seen(0), room="attic")).status_code == 409


async def test_a_refused_batch_does_not_touch_those_beside_it(http: httpx.AsyncClient, post, seen) -> None:
    """Posted together, they share a transaction."""
    await post(seen(0))
    good = [post(seen(n, label=f"a{n}/1", type="mover_entered", xy=[0, 0]), agent=f"a{n}") for n in range(10)]
    answers = await asyncio.gather(*good, post({**seen(0), "xy": [9, 9]}), post(seen(1), room="nowhere"))
    assert [answer.status_code for answer in answers] == [200] * 10 + [409, 404]
    page = (await http.get("/v1/agents")).json()
    assert {item["agent"] for item in page["items"]} == {"cab", *(f"a{n}" for n in range(10))}


async def test_agents_are_paged_and_a_fresh_one_starts_at_zero(http: httpx.AsyncClient, post, seen) -> None:
    for name in ("a", "b", "c"):
        await post(seen(5, type="agent_state", state="faulty", why="no cell\x00"), agent=name)
    assert (await http.get("/v1/agents/new")).json()["next_seq"] == 0
    first = (await http.get("/v1/agents", params={"limit": 2})).json()
    rest = (await http.get("/v1/agents", params={"limit": 2, "cursor": first["next_cursor"]})).json()
    agents = first["items"] + rest["items"]
    assert [agent["agent"] for agent in agents] == ["a", "b", "c"]
    assert {(agent["state"], agent["missing"], agent["next_seq"]) for agent in agents} == {("faulty", 5, 6)}
    assert rest["next_cursor"] is None


async def test_two_agents_under_one_name_are_told_to_whoever_looks(http: httpx.AsyncClient, post, seen) -> None:
    """Each is refused what the other was first with; it must not look like one agent that is well."""
    await post(seen(0, type="agent_state", state="connected", why=""), seen(1))
    await post(seen(0, label="b/1"), agent="b")
    assert (await post({**seen(1), "xy": [4, 4]})).status_code == 409
    await post(seen(2, type="agent_state", state="connected", why=""))  # the one of both that is first goes on
    agent = (await http.get("/v1/agents/cab")).json()
    assert agent["state"] == "faulty" and agent["why"].startswith("does another agent run under this name? Each")
    assert agent["why"].endswith("cab: seq 1 is recorded with another body; nothing of the batch was recorded")
    page = (await http.get("/v1/agents")).json()
    assert {item["agent"]: item["state"] for item in page["items"]} == {"b": "connected", "cab": "faulty"}
