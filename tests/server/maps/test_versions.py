"""Maps and their versions over HTTP, on both databases."""

from __future__ import annotations

import asyncio
import zlib
from collections.abc import Awaitable, Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import httpx
import numpy as np
from conftest import client, running
from fastapi import FastAPI
from map_robot import MAP, ROOM, Robot, measured, text, tile
from sqlalchemy import func, select

from tms_schemas.tiles import CELLS, pack, to_text
from tms_server.db.session import Sessions
from tms_server.db.tables import MapBlobRow, MapTileRow, MapVersionRow

DOOR = {"tag": "E1", "x": 1.0, "y": 2.0, "theta": 0.5, "state": "open"}


async def test_a_map_comes_back_as_it_was_put(http: httpx.AsyncClient, robot: Robot) -> None:
    found = (await http.get("/v1/maps/corridor")).json()
    assert {name: found[name] for name in MAP} == MAP and found["version"] == 0
    again = await http.put("/v1/maps/corridor", json=MAP)
    assert again.status_code == 200 and again.json() == found
    assert (await http.put("/v1/maps/other", json={"room": "lab", "resolution": 0.02})).status_code == 201
    listed = (await http.get("/v1/maps", params={"limit": 1})).json()
    rest = (await http.get("/v1/maps", params={"cursor": listed["next_cursor"], "room": "lab"})).json()
    assert [one["id"] for one in listed["items"] + rest["items"]] == ["corridor", "other"]
    assert (await http.delete("/v1/maps/other")).status_code == 204
    assert (await http.get("/v1/maps/other")).status_code == 404
    assert (await http.delete("/v1/maps/other")).status_code == 404


async def test_a_map_with_versions_stays_in_its_place(http: httpx.AsyncClient, robot: Robot) -> None:
    assert (await http.put("/v1/maps/corridor", json=MAP | {"resolution": 0.1})).status_code == 200
    assert (await http.put("/v1/maps/corridor", json=MAP)).status_code == 200
    await robot.send(0, {(0, 0): tile(fill=0)})
    for change in ({"resolution": 0.1}, {"origin": [0, 0]}):
        answer = await http.put("/v1/maps/corridor", json=MAP | change)
        assert answer.status_code == 409 and next(iter(change)) in answer.json()["detail"]
    moved = await http.put("/v1/maps/corridor", json=MAP | {"map_to_room": None, "name": None})
    assert moved.status_code == 200 and moved.json()["map_to_room"] is None and moved.json()["version"] == 1


async def test_a_bad_map_is_refused(http: httpx.AsyncClient, robot: Robot) -> None:
    for body in ({"room": "nowhere"}, {"resolution": 0}, {"origin": [0]}, {"map_to_room": [0, 0]}, {"colour": 1}):
        answer = await http.put("/v1/maps/new", json=MAP | body)
        assert answer.status_code == 422 and answer.json()["items"][0]["where"].startswith(next(iter(body)))
    for name in ("a.png", "-a", "a" * 65):
        assert (await http.put(f"/v1/maps/{name}", json=MAP)).status_code in (405, 422)
    assert (await http.get("/v1/maps/new")).status_code == 404


async def test_only_changed_tiles_travel(robot: Robot) -> None:
    a, b, c = tile((3, 4, 254)), tile((0, 0, 10), (63, 63, 254)), tile(fill=0)
    made = await robot.send(0, {(0, 0): a, (-1, 2): b}, note="first look")
    assert made.status_code == 201
    version = made.json()
    assert (version["version"], version["agent"], version["note"], version["changed"]) == (1, "robot", "first look", 2)
    assert version["bounds"] == [-64, 4, 4, 192]
    assert (await robot.send(1, {(0, 0): c, (5, 0): a})).json()["version"] == 2
    assert await robot.tiles() == {(-1, 2): text(b), (0, 0): text(c), (5, 0): text(a)}
    assert await robot.tiles(version=1) == {(-1, 2): text(b), (0, 0): text(a)}
    assert await robot.tiles(since=1) == {(0, 0): text(c), (5, 0): text(a)}
    assert await robot.tiles(since=2) == {}
    removed = await robot.send(2, {(0, 0): a}, removed=[{"x": -1, "y": 2}, {"x": 9, "y": 9}])
    assert removed.json()["changed"] == 2 and removed.json()["bounds"] == [3, 4, 324, 5]
    assert await robot.tiles(since=1) == {(-1, 2): None, (0, 0): text(a), (5, 0): text(a)}
    assert await robot.tiles(since=2, version=2) == {}
    await robot.send(3, {(-1, 2): c})
    assert await robot.tiles(since=2) == {(-1, 2): text(c), (0, 0): text(a)}
    assert await robot.tiles(since=2, version=3) == {(-1, 2): None, (0, 0): text(a)}


async def test_tiles_page_by_cursor(http: httpx.AsyncClient, robot: Robot) -> None:
    places = [(x, y) for x in (-7, -1, 0, 10) for y in (-10, -9, 2, 11)]
    await robot.send(0, {place: tile((0, 0, i)) for i, place in enumerate(places)})
    await robot.send(1, removed=[{"x": x, "y": y} for x, y in places[::3]])
    seen: list[tuple[int, int, bool]] = []
    params: dict[str, Any] = {"since": 1, "limit": 2}
    while True:
        page = (await http.get("/v1/maps/corridor/tiles", params=params)).json()
        seen += [(one["x"], one["y"], one["digest"] is None) for one in page["tiles"]]
        if page["next_cursor"] is None:
            break
        params |= {"cursor": page["next_cursor"], "version": page["version"]}
    assert seen == [(*place, True) for place in places[::3]]
    lean = (await http.get("/v1/maps/corridor/tiles", params={"version": 1, "data": False})).json()["tiles"]
    assert [(one["x"], one["y"]) for one in lean] == places
    assert all(one["data"] is None and len(one["digest"]) == 64 for one in lean)
    for cursor in ("nonsense", "WyJhIiwiYiJd", "WyIxIl0"):
        assert (await http.get("/v1/maps/corridor/tiles", params={"cursor": cursor})).status_code == 422
    assert (await http.get("/v1/maps/corridor/tiles", params={"since": 3})).status_code == 422
    assert (await http.get("/v1/maps/corridor/tiles", params={"version": 3})).status_code == 404


async def test_any_history_reads_back(robot: Robot, random: np.random.Generator) -> None:
    """Random changes: every version is what was sent, and the difference leads from any version to any later one."""
    kinds = [None, *(text(tile((i, i, i))) for i in range(3))]
    history: list[dict[tuple[int, int], str]] = [{}]
    for base in range(8):
        now = dict(history[-1])
        changes = {(int(x), int(y)): int(random.integers(4)) for x, y in random.integers(-2, 2, (5, 2))}
        tiles = {place: tile((kind - 1,) * 3) for place, kind in changes.items() if kind}
        removed = [{"x": x, "y": y} for (x, y), kind in changes.items() if not kind]
        answer = await robot.send(base, tiles, removed=removed, note=str(base), objects=[DOOR | {"x": base}])
        assert answer.status_code == 201
        now |= {place: kinds[kind] for place, kind in changes.items()}  # type: ignore[dict-item]
        history.append({place: one for place, one in now.items() if one is not None})
    for version, wanted in enumerate(history):
        assert await robot.tiles(version=version) == wanted
        for since in range(version):
            got: dict[tuple[int, int], str | None] = dict(history[since])
            got |= await robot.tiles(since=since, version=version)
            assert {place: one for place, one in got.items() if one is not None} == wanted


async def test_another_base_is_a_conflict_and_the_same_request_again_is_not(robot: Robot) -> None:
    one, other = {(0, 0): tile((0, 0, 1))}, {(0, 0): tile((0, 0, 2))}
    first = await robot.send(0, one)
    again = await robot.send(0, one)
    assert (again.status_code, again.json()) == (200, first.json())
    late = await robot.send(0, other)
    assert late.status_code == 409 and "newest version of map 'corridor' is 1, not 0" in late.json()["detail"]
    assert (await robot.send(5, one)).status_code == 409
    assert (await robot.send(1, other)).json()["version"] == 2
    assert (await robot.send(0, one)).json() == first.json()  # also when others have gone on
    other_packing = {"x": 0, "y": 0, "data": to_text(b"\1" + zlib.compress(tile((0, 0, 1)).occupancy, 0))}
    body = {"base": 0, "agent": "robot", "tiles": [other_packing]}
    assert (await robot.http.post("/v1/maps/corridor/versions", json=body)).json() == first.json()


async def test_what_changes_nothing_makes_no_version(http: httpx.AsyncClient, robot: Robot) -> None:
    blank = tile()
    first = await robot.send(0, {(0, 0): tile(fill=0), (1, 1): blank}, objects=[])
    assert first.json()["changed"] == 1
    for again in (
        await robot.send(1),
        await robot.send(1, {(0, 0): tile(fill=0)}),
        await robot.send(1, {(3, 3): blank}, removed=[{"x": 8, "y": 8}], objects=[]),
    ):
        assert (again.status_code, again.json()) == (200, first.json())
    emptied = (await robot.send(1, {(0, 0): blank})).json()
    assert (emptied["version"], emptied["bounds"]) == (2, None)
    assert (await http.get("/v1/maps/corridor.png")).status_code == 200


async def test_racing_robots_make_one_version(app: FastAPI, robot: Robot) -> None:
    async with client(app) as http:
        answers = await asyncio.gather(*(Robot(http).send(0, {(0, 0): tile((0, 0, i))}, note=str(i)) for i in range(5)))
    assert sorted(one.status_code for one in answers) == [201, 409, 409, 409, 409]


async def test_content_is_stored_once(robot: Robot, sessions: Sessions) -> None:
    same = tile(fill=3)
    await robot.send(0, {(x, 0): same for x in range(20)})
    await robot.send(1, {(0, 0): tile(fill=4)})
    await robot.send(2, {(0, 0): same})
    async with sessions.read() as session:
        assert await session.scalar(select(func.count()).select_from(MapBlobRow)) == 2
    await robot.http.delete("/v1/maps/corridor")
    async with sessions.read() as session:
        for table in (MapBlobRow, MapTileRow, MapVersionRow):
            assert await session.scalar(select(func.count()).select_from(table)) == 0


async def test_tiles_sent_ahead(http: httpx.AsyncClient, robot: Robot) -> None:
    ahead = [tile((1, 1, i)) for i in range(3)] + [tile()]
    kept = await http.post("/v1/maps/corridor/tiles", json={"tiles": [text(one) for one in ahead]})
    digests = kept.json()["digests"]
    assert digests == [one.digest for one in ahead]
    assert (await robot.tiles()) == {}
    made = await robot.send(0, {(i, 0): digest for i, digest in enumerate(digests)} | {(9, 9): tile(fill=1)})
    assert made.status_code == 201 and made.json()["changed"] == 4
    assert await robot.tiles() == {(i, 0): text(ahead[i]) for i in range(3)} | {(9, 9): text(tile(fill=1))}
    unknown = await robot.send(1, {(0, 0): digests[1], (1, 0): "0" * 64})
    assert unknown.status_code == 422 and unknown.json()["items"][0]["where"] == "tiles/1/digest"
    assert (await http.get("/v1/maps/corridor")).json()["version"] == 1


class Ticking:
    """A clock that tests set."""

    def __init__(self) -> None:
        self.at = datetime(2026, 11, 1, tzinfo=UTC)

    def now(self) -> datetime:
        return self.at


async def test_tiles_that_no_version_names_go(database_url: str, tmp_path: Any) -> None:
    from tms_server.app import create_app
    from tms_server.settings import Settings

    clock = Ticking()
    app = create_app(Settings(data_dir=tmp_path, database_url=database_url), clock=clock)
    async with running(app), client(app) as http:
        await http.put("/v1/rooms/lab", json=ROOM)
        await http.put("/v1/maps/corridor", json=MAP)
        robot = Robot(http)
        forgotten, fresh, used = (tile((1, 1, i)) for i in range(3))
        await http.post("/v1/maps/corridor/tiles", json={"tiles": [text(forgotten), text(fresh), text(used)]})
        clock.at += timedelta(minutes=50)
        await http.post("/v1/maps/corridor/tiles", json={"tiles": [text(fresh)]})
        for base in range(16):
            if base == 15:
                clock.at += timedelta(minutes=20)
            answer = await robot.send(base, {(0, 0): used.digest if base == 0 else tile((2, 2, base))})
            assert answer.status_code == 201
        assert (await robot.send(16, {(1, 0): forgotten.digest})).status_code == 422
        assert (await robot.send(16, {(1, 0): fresh.digest, (2, 0): used.digest})).status_code == 201


async def test_bad_tiles_are_named_and_nothing_is_kept(http: httpx.AsyncClient, robot: Robot) -> None:
    good = text(tile(fill=7))
    bomb = to_text(b"\1" + zlib.compress(bytes(1_000_000), 9))
    nan, negative = measured((1, 1), float("nan"), 0, 1), measured((1, 1), 1, -1, 1)
    for data, why in (
        ("****", "base64"),
        (to_text(b"\2abc"), "layers"),
        (to_text(b"\1abc"), "zlib"),
        (bomb, "more than 4096"),
        (to_text(b"\1" + zlib.compress(bytes(CELLS - 1))), "4095"),
        (to_text(b"\3" + zlib.compress(bytes(CELLS))), "4096"),
        (to_text(pack(tile()) + b"x"), "followed"),
        (to_text(pack(tile())[:-2]), "ends too early"),
        (text(nan), "finite"),
        (text(measured((1, 1), float("inf"), 0, 1)), "finite"),
        (text(negative), "negative"),
        (text(measured((1, 1), 1, 0, 0)), "0 times"),
    ):
        body = {
            "base": 0,
            "agent": "robot",
            "tiles": [{"x": 0, "y": 0, "data": good}, {"x": 1, "y": 0, "data": data}],
        }
        answer = await http.post("/v1/maps/corridor/versions", json=body)
        assert answer.status_code == 422, why
        (item,) = answer.json()["items"]
        assert item["where"] == "tiles/1/data" and why in item["why"]
        ahead = await http.post("/v1/maps/corridor/tiles", json={"tiles": [data]})
        assert ahead.status_code == 422 and why in ahead.json()["items"][0]["why"]
    assert (await http.get("/v1/maps/corridor")).json()["version"] == 0


async def test_bad_versions_are_refused(http: httpx.AsyncClient, robot: Robot) -> None:
    one = {"x": 0, "y": 0, "data": text(tile(fill=1))}
    for change in (
        {"tiles": [one, one]},
        {"tiles": [one], "removed": [{"x": 0, "y": 0}]},
        {"tiles": [{"x": 0, "y": 0}]},
        {"tiles": [one | {"digest": "0" * 64}]},
        {"tiles": [one | {"x": 2**20}]},
        {"tiles": [one | {"x": 0.5}]},
        {"tiles": [one | {"data": "A" * 100_000}]},
        {"tiles": [{"x": x, "y": x, "data": one["data"]} for x in (0, 2**19)]},
        {"objects": [DOOR, DOOR]},
        {"objects": [DOOR | {"x": None}]},
        {"base": -1},
        {"agent": "a b"},
    ):
        body = {"base": 0, "agent": "robot"} | change
        answer = await http.post("/v1/maps/corridor/versions", json=body)
        assert answer.status_code == 422, change
    assert (await http.get("/v1/maps/corridor")).json()["version"] == 0
    assert await robot.tiles() == {}
    nowhere = await http.post("/v1/maps/nowhere/versions", json={"base": 0, "agent": "robot"})
    assert nowhere.status_code == 404
    huge = await http.post("/v1/maps/corridor/tiles", content=b"x" * 5_000_000)
    assert huge.status_code == 413


async def test_versions_list_newest_first(http: httpx.AsyncClient, robot: Robot) -> None:
    for base in range(5):
        await robot.send(base, {(0, 0): tile((0, 0, base))})
    page = (await http.get("/v1/maps/corridor/versions", params={"limit": 3})).json()
    rest = (await http.get("/v1/maps/corridor/versions", params={"cursor": page["next_cursor"]})).json()
    assert [one["version"] for one in page["items"] + rest["items"]] == [5, 4, 3, 2, 1]
    assert rest["next_cursor"] is None
    assert (await http.get("/v1/maps/corridor/versions/2")).json() == rest["items"][0]
    for missing in (0, 6):
        assert (await http.get(f"/v1/maps/corridor/versions/{missing}")).status_code == 404


async def test_objects_of_any_version(http: httpx.AsyncClient, robot: Robot) -> None:
    bin_ = {"tag": "B2", "x": 4.0, "y": 0.0, "theta": 0.0, "state": None}

    async def objects(**params: int) -> Any:
        found = (await http.get("/v1/maps/corridor/objects", params=params)).json()["objects"]
        return [{name: value for name, value in one.items() if name in DOOR} for one in found]

    assert await objects() == []
    await robot.send(0, {(0, 0): tile(fill=0)}, objects=[DOOR, bin_])
    await robot.send(1, {(0, 0): tile(fill=1)})
    await robot.send(2, objects=[DOOR | {"state": "closed"}])
    assert await objects(version=1) == await objects(version=2) == [bin_, DOOR]
    assert await objects() == [DOOR | {"state": "closed"}]
    assert (await robot.send(3, objects=[])).json()["version"] == 4
    assert await objects() == [] and await objects(version=0) == []
    diff = (await http.get("/v1/maps/corridor/diff", params={"before": 1, "after": 3})).json()
    assert [one["tag"] for one in diff["objects"]] == ["B2", "E1"]
    gone, closed = diff["objects"]
    assert gone["before"]["x"] == 4.0 and gone["after"] is None
    assert (closed["before"]["state"], closed["after"]["state"], closed["moved_m"]) == ("open", "closed", 0.0)


async def test_keys_see_and_change_maps_of_their_rooms(
    http: httpx.AsyncClient, robot: Robot, make_key: Callable[..., Awaitable[str]]
) -> None:
    await http.put("/v1/rooms/kitchen", json=ROOM)
    await http.put("/v1/maps/oven", json=MAP | {"room": "kitchen"})
    reader = {"Authorization": f"Bearer {await make_key('read:lab')}"}
    driver = {"Authorization": f"Bearer {await make_key('observe:kitchen')}"}
    names = [one["id"] for one in (await http.get("/v1/maps", headers=reader)).json()["items"]]
    assert names == ["corridor"]
    body = {"base": 0, "agent": "robot", "tiles": [{"x": 0, "y": 0, "data": text(tile(fill=1))}]}
    for path, method, json in (
        ("/v1/maps/oven", "GET", None),
        ("/v1/maps/oven.png", "GET", None),
        ("/v1/maps/oven/tiles", "GET", None),
        ("/v1/maps/corridor/versions", "POST", body),
        ("/v1/maps/corridor/tiles", "POST", {"tiles": [body["tiles"][0]["data"]]}),  # type: ignore[index]
        ("/v1/maps/corridor", "PUT", MAP),
        ("/v1/maps/corridor", "DELETE", None),
    ):
        assert (await http.request(method, path, json=json, headers=reader)).status_code == 403, path
    assert (await http.get("/v1/maps/corridor.pgm", headers=reader)).status_code == 200
    assert (await http.put("/v1/maps/oven", json=MAP | {"room": "lab"}, headers=driver)).status_code == 403
    assert (await http.put("/v1/maps/corridor", json=MAP | {"room": "kitchen"}, headers=driver)).status_code == 403
    assert (await http.post("/v1/maps/oven/versions", json=body, headers=driver)).status_code == 201
    assert (await http.get("/v1/maps/oven/tiles", headers=driver)).status_code == 200


async def test_the_room_is_told(http: httpx.AsyncClient, robot: Robot, registry: Any) -> None:
    await robot.send(0, {(0, 0): tile(fill=1)})
    await robot.send(0, {(0, 0): tile(fill=1)})
    await http.delete("/v1/maps/corridor")
    told = [one for one in await registry("lab") if one["type"] == "map_changed"]
    assert [(one["map"], one["version"]) for one in told] == [("corridor", 0), ("corridor", 1), ("corridor", None)]
    assert (await http.get("/v1/rooms/lab/anomalies")).json()["anomalies"] == []
