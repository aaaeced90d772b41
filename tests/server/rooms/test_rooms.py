"""Rooms over HTTP, on both databases."""

from __future__ import annotations

import copy
import math
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_server.rooms.polygons import area

SQUARE = [[0, 0], [4, 0], [4, 3], [0, 3]]
LAB: dict[str, Any] = {
    "name": "実験室",
    "frame": "origin at the south-west corner",
    "outline": SQUARE,
    "furniture": [
        {
            "id": "cabinet-a",
            "name": "Cabinet A",
            "polygon": [[0, 0], [0.4, 0], [0.4, 0.5], [0, 0.5]],
            "surfaces": [{"id": "shelf", "polygon": [[0, 0], [0.4, 0], [0.4, 0.5], [0, 0.5]], "z": 0.8}],
            "agent": "cabinet-a",
        }
    ],
    "sensors": [
        {"agent": "cabinet-a", "kind": "load cells", "zones": [{"id": "antenna", "polygon": [[0, 0], [1, 0], [0, 1]]}]}
    ],
    "params": {"sigma_m": 0.4, "alpha": {"cabinet": 0.99}},
    "seed": 7,
}


def changed(**fields: Any) -> dict[str, Any]:
    return copy.deepcopy(LAB) | fields


Registry = Callable[[str], Awaitable[list[dict[str, Any]]]]


async def test_a_room_comes_back_as_it_was_put(http: httpx.AsyncClient) -> None:
    answer = await http.put("/v1/rooms/lab", json=LAB)
    assert answer.status_code == 201
    found = (await http.get("/v1/rooms/lab")).json()
    assert found == answer.json()
    assert found["id"] == "lab"
    assert found["name"] == "実験室"
    assert found["furniture"][0]["surfaces"][0]["id"] == "shelf"
    assert found["params"] == LAB["params"]


async def test_a_change_is_a_record_and_the_same_body_again_is_none(
    http: httpx.AsyncClient, registry: Registry
) -> None:
    first = (await http.put("/v1/rooms/lab", json=LAB)).json()
    again = await http.put("/v1/rooms/lab", json=LAB)
    assert again.status_code == 200
    assert again.json() == first
    assert [record["type"] for record in await registry("lab")] == ["room_changed"]
    moved = changed(params={"sigma_m": 0.3})
    assert (await http.put("/v1/rooms/lab", json=moved)).status_code == 200
    records = await registry("lab")
    assert [record["room"]["params"].get("sigma_m") for record in records] == [0.4, 0.3]
    assert (await http.get("/v1/rooms/lab")).json()["created_at"] == first["created_at"]


BAD: list[tuple[dict[str, Any], str]] = [
    (changed(params={"sigma": 1}), "params"),
    (changed(params={"sigma_m": -1}), "params"),
    (changed(params={"sigma_m": 10**400}), "params"),
    (changed(params={"alpha": {"fridge": 0.9}}), "params"),
    (changed(params={"p_read": "often"}), "params"),
    (changed(params={"p_jump": {"a": {"b": []}}}), "params"),
    (changed(outline=[[0, 0], [1, 1], [2, 2]]), "outline"),
    (changed(outline=[[0, 0], [1, 1]]), "outline"),
    (changed(outline=[[0, 0], [1, 0], [0, 1e7]]), "outline/2/1"),
    (changed(furniture=LAB["furniture"] * 2), "body"),
    (
        changed(furniture=[LAB["furniture"][0] | {"polygon": [[1, 1]] * 3}]),
        "furniture/0/polygon",
    ),
    (
        changed(sensors=[LAB["sensors"][0] | {"zones": LAB["sensors"][0]["zones"] * 2}]),
        "sensors/0/zones",
    ),
    (changed(colour="blue"), "colour"),
    (changed(seed=-1), "seed"),
    (changed(seed=2**63), "seed"),
    (changed(name=""), "name"),
]


async def test_a_bad_room_is_refused_by_name(http: httpx.AsyncClient) -> None:
    for body, where in BAD:
        answer = await http.put("/v1/rooms/lab", json=body)
        assert answer.status_code == 422, (where, answer.text)
        assert where in [item["where"] for item in answer.json()["items"]]
    assert (await http.get("/v1/rooms/lab")).status_code == 404


async def test_no_number_is_no_number(http: httpx.AsyncClient) -> None:
    for text in ("NaN", "Infinity", "1e999"):
        body = '{"name": "x", "outline": [[0, 0], [1, 0], [0, ' + text + "]]}"
        answer = await http.put("/v1/rooms/lab", content=body, headers={"Content-Type": "application/json"})
        assert answer.status_code == 422
        assert answer.json()["items"][0]["where"] == "outline/2/1"


async def test_a_bad_room_id_is_refused(http: httpx.AsyncClient) -> None:
    for room in ("-lab", "a b", "a" * 65, "%00", "%FF"):
        assert (await http.put(f"/v1/rooms/{room}", json=LAB)).status_code == 422
        assert (await http.get(f"/v1/rooms/{room}")).status_code == 422


async def test_an_unknown_room_is_not_found(http: httpx.AsyncClient) -> None:
    answer = await http.get("/v1/rooms/nowhere")
    assert answer.status_code == 404
    assert "nowhere" in answer.json()["detail"]


async def test_rooms_page_by_cursor(http: httpx.AsyncClient) -> None:
    names = ["b", "B", "a-1", "a", "0"]
    for name in names:
        await http.put(f"/v1/rooms/{name}", json={"name": name, "outline": SQUARE})
    seen: list[str] = []
    cursor: dict[str, str] = {}
    while True:
        page = (await http.get("/v1/rooms", params={"limit": 2} | cursor)).json()
        seen += [room["id"] for room in page["items"]]
        if page["next_cursor"] is None:
            break
        cursor = {"cursor": page["next_cursor"]}
    assert seen == sorted(names)
    assert (await http.get("/v1/rooms", params={"cursor": "nonsense"})).status_code == 422
    assert (await http.get("/v1/rooms", params={"limit": 0})).status_code == 422


async def test_keys_see_their_rooms(http: httpx.AsyncClient, make_key: Callable[..., Awaitable[str]]) -> None:
    for name in ("lab", "kitchen", "hall"):
        await http.put(f"/v1/rooms/{name}", json=changed(name=name))
    key = await make_key("read:lab", "observe:kitchen")
    mine = {"Authorization": f"Bearer {key}"}
    assert [room["id"] for room in (await http.get("/v1/rooms", headers=mine)).json()["items"]] == ["kitchen", "lab"]
    assert (await http.get("/v1/rooms/lab", headers=mine)).status_code == 200
    assert (await http.get("/v1/rooms/hall", headers=mine)).status_code == 403
    assert (await http.put("/v1/rooms/lab", json=LAB, headers=mine)).status_code == 403
    assert (await http.get("/v1/rooms/lab")).status_code == 401


numbers = st.floats(-1e6, 1e6, allow_nan=False)
points = st.tuples(numbers, numbers)


@given(st.lists(points, min_size=3, max_size=8), st.integers(0, 7))
def test_area_does_not_depend_on_start_or_direction(polygon: list[tuple[float, float]], turn: int) -> None:
    turned = polygon[turn % len(polygon) :] + polygon[: turn % len(polygon)]
    scale = max(1.0, area(polygon))
    assert math.isclose(area(turned), area(polygon), abs_tol=1e-3 * scale)
    assert math.isclose(area(polygon[::-1]), area(polygon), abs_tol=1e-3 * scale)
    assert math.isfinite(area(polygon))


def test_area_of_a_rectangle_far_out() -> None:
    corners = [(1e5, 1e5), (1e5 + 0.5, 1e5), (1e5 + 0.5, 1e5 + 0.25), (1e5, 1e5 + 0.25)]
    assert area(corners) == pytest.approx(0.125)
