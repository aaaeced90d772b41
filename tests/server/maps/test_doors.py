"""Which doors are open, and what moved from one version to another."""

from __future__ import annotations

from typing import Any

import httpx
import numpy as np
import pytest
from map_robot import Robot, tile

PANEL = [[0, -0.02], [1, -0.02], [1, 0.02], [0, 0.02]]
DOOR = {"tag": "D1", "x": 1.0, "y": 2.0, "theta": 0.5, "state": "open", "angle": 0.9}
OTHER = {"tag": "D2", "x": 3.0, "y": 2.0, "theta": 0.0, "state": "closed", "angle": 0.02}
BIN = {"tag": "B1", "x": 5.0, "y": 2.0, "theta": 0.0}


async def doors(http: httpx.AsyncClient, **params: Any) -> list[dict[str, Any]]:
    answer = await http.get("/v1/rooms/lab/doors", params=params)
    assert answer.status_code == 200
    return answer.json()["doors"]  # type: ignore[no-any-return]


async def test_which_doors_are_open(http: httpx.AsyncClient, robot: Robot) -> None:
    assert await doors(http) == []
    await robot.send(0, {(0, 0): tile(fill=0)}, objects=[DOOR, OTHER, BIN])
    both = await doors(http)
    assert [(one["tag"], one["state"], one["angle"]) for one in both] == [("D1", "open", 0.9), ("D2", "closed", 0.02)]
    assert [one["tag"] for one in await doors(http, state="open")] == ["D1"]
    assert [one["tag"] for one in await doors(http, state="closed")] == ["D2"]
    # It closes: the newest version counts, and it keeps what later versions say nothing of.
    await robot.send(1, objects=[DOOR | {"state": "closed", "theta": -0.4, "angle": 0.0}, OTHER, BIN])
    await robot.send(2, {(0, 0): tile(fill=10)})
    assert await doors(http, state="open") == []
    assert {one["version"] for one in await doors(http)} == {3}


async def test_doors_have_names_and_a_place_in_the_room(http: httpx.AsyncClient, robot: Robot) -> None:
    shape = {"class": "door_small", "polygon": PANEL}
    await http.put("/v1/objects/D1", json={"name": "the ward's door", "room": "lab", "tracking": "map", "shape": shape})
    await robot.send(0, objects=[DOOR | {"state": None, "angle": None}, BIN])
    (door,) = await doors(http)
    assert door["name"] == "the ward's door" and door["state"] == "unknown" and door["pose"] == [1.0, 2.0, 0.5]
    x, y, theta = (1, 2, 0.5)  # map_to_room of the map
    turned = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]]) @ [1.0, 2.0]
    np.testing.assert_allclose(door["room_pose"], [x + turned[0], y + turned[1], 1.0])
    assert [one["tag"] for one in await doors(http, state="unknown")] == ["D1"]


async def test_of_two_maps_the_door_that_was_seen_last_counts(http: httpx.AsyncClient, robot: Robot) -> None:
    await robot.send(0, objects=[DOOR | {"seen_at": "2026-01-02T00:00:00Z"}])
    await http.put("/v1/maps/second", json={"room": "lab", "resolution": 0.05})
    for hour, state in ((3, "closed"), (1, "open")):
        seen = DOOR | {"state": state, "seen_at": f"2026-01-0{hour}T00:00:00Z"}
        base = (await http.get("/v1/maps/second")).json()["version"]
        body = {"base": base, "agent": "r2", "objects": [seen]}
        assert (await http.post("/v1/maps/second/versions", json=body)).status_code == 201
        (door,) = await doors(http)
        assert (door["map"], door["state"]) == (("second", "closed") if hour == 3 else ("corridor", "open"))
        assert door["seen_at"] == ("2026-01-03T00:00:00Z" if hour == 3 else "2026-01-02T00:00:00Z")


async def test_a_room_that_is_not_there_has_no_answer(http: httpx.AsyncClient, robot: Robot) -> None:
    assert (await http.get("/v1/rooms/nowhere/doors")).status_code == 404
    assert (await http.get("/v1/rooms/lab/doors", params={"state": "ajar"})).status_code == 422


async def test_how_far_objects_moved(http: httpx.AsyncClient, robot: Robot) -> None:
    await robot.send(0, objects=[DOOR, OTHER, BIN])
    moved = [
        DOOR | {"theta": 0.5 + 2 * np.pi - 1.0, "seen_at": "2026-01-02T00:00:00Z"},
        OTHER | {"seen_at": "2026-01-02T00:00:00Z"},
        BIN | {"x": 5.3, "y": 2.4},
        {"tag": "B2", "x": 0.0, "y": 0.0, "theta": 0.0},
    ]
    await robot.send(1, objects=moved)

    async def changed(**params: Any) -> dict[str, Any]:
        found = (await http.get("/v1/maps/corridor/diff", params={"before": 1, **params})).json()
        return {one["tag"]: one for one in found["objects"]}

    every = await changed()
    assert sorted(every) == ["B1", "B2", "D1"]  # to be seen again is no move
    assert every["B1"]["moved_m"] == pytest.approx(0.5) and every["B1"]["turned_rad"] == 0
    assert every["D1"]["moved_m"] == 0 and every["D1"]["turned_rad"] == pytest.approx(1.0)
    assert every["B2"]["before"] is None and every["B2"]["moved_m"] is None
    assert sorted(await changed(least_m=0.6, least_rad=0.5)) == ["B2", "D1"]
    assert sorted(await changed(least_m=0.4, least_rad=1.1)) == ["B1", "B2"]


async def test_the_same_objects_again_make_no_version(http: httpx.AsyncClient, robot: Robot) -> None:
    await robot.send(0, objects=[DOOR, BIN])
    assert (await robot.send(1, objects=[BIN, DOOR])).status_code == 200
    assert (await http.get("/v1/maps/corridor")).json()["version"] == 1
