"""Objects over HTTP, on both databases: put, patch, delete, list, and what the room's log is told."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
from hypothesis import given, settings
from hypothesis import strategies as st

Registry = Callable[[str], Awaitable[list[dict[str, Any]]]]
TEA = "4901234567894"


async def put(town: httpx.AsyncClient, tag: str = "E1", **body: Any) -> dict[str, Any]:
    answer = await town.put(f"/v1/objects/{tag}", json={"name": "thing"} | body)
    assert answer.is_success, answer.text
    found: dict[str, Any] = answer.json()
    return found


async def test_an_object_comes_back_as_it_was_put(town: httpx.AsyncClient) -> None:
    body = {
        "name": "湯呑み",
        "synonyms": ["cup", "コップ"],
        "jan": None,
        "size_m": [0.08, 0.08, 0.1],
        "weight_g": 180.5,
        "weight_sd_g": 2.0,
        "category": "食器",
        "room": "lab",
        "tracking": "placement",
        "tag_pose": [0.0, 0.04, 1.57],
        "user_memory": "00ff" * 96,
    }
    stored = await put(town, "e004-0100", **body)
    assert {name: stored[name] for name in body} == body
    assert stored["tag"] == "E004-0100"
    assert (await town.get("/v1/objects/E004-0100")).json() == stored
    assert (await town.get("/v1/objects/e004-0100")).json() == stored
    assert (await put(town, size_m=0.1))["size_m"] == [0.1, 0.1, 0.1]


async def test_gaps_are_filled_from_the_product(town: httpx.AsyncClient) -> None:
    stored = await put(town, jan="0" + TEA)
    assert stored["jan"] == TEA
    assert (stored["weight_g"], stored["weight_sd_g"], stored["category"]) == (520, 4, "飲み物")
    assert stored["size_m"] == [0.06, 0.08, 0.2]
    weighed = await put(town, jan=TEA, weight_g=300, category="empty")
    assert (weighed["weight_g"], weighed["weight_sd_g"], weighed["category"]) == (300, None, "empty")


async def test_the_same_put_again_changes_nothing(town: httpx.AsyncClient, registry: Registry) -> None:
    body = {"name": "tea", "jan": TEA, "room": "lab", "synonyms": ["a"], "tag_pose": [0, 0, 1], "user_memory": "AB"}
    first = await town.put("/v1/objects/E1", json=body)
    again = await town.put("/v1/objects/E1", json=body)
    assert (first.status_code, again.status_code) == (201, 200)
    assert again.json() == first.json()
    assert [record["type"] for record in await registry("lab")] == ["room_changed", "object_registered"]


async def test_the_log_is_told_all_that_alters_a_belief(town: httpx.AsyncClient, registry: Registry) -> None:
    await put(town, jan=TEA, room="lab")
    await town.patch("/v1/objects/E1", json={"weight_g": 100, "weight_sd_g": 3, "size_m": 0.5})
    await town.patch("/v1/objects/E1", json={"category": "not of the belief"})
    await town.patch("/v1/objects/E1", json={"room": "kitchen"})
    await town.patch("/v1/objects/E1", json={"weight_g": None, "weight_sd_g": None})
    await town.put(f"/v1/products/{TEA}", json={"name": "tea", "weight_g": 480})
    await town.patch("/v1/objects/E1", json={"tracking": "map"})
    await town.patch("/v1/objects/E1", json={"weight_g": 1})
    await town.patch("/v1/objects/E1", json={"tracking": None})
    await town.delete("/v1/objects/E1")
    thing = {"tag": "E1", "name": "thing", "size_m": 0.5}
    assert (await registry("lab"))[1:] == [
        thing | {"type": "object_registered", "weight_g": 520, "weight_sd_g": 4, "size_m": 0.07},
        thing | {"type": "object_changed", "weight_g": 100, "weight_sd_g": 3},
        {"type": "object_removed", "tag": "E1"},
    ]
    assert (await registry("kitchen"))[1:] == [
        thing | {"type": "object_registered", "weight_g": 100, "weight_sd_g": 3},
        thing | {"type": "object_changed", "weight_g": 520, "weight_sd_g": 4},
        thing | {"type": "object_changed", "weight_g": 480, "weight_sd_g": 0},
        {"type": "object_removed", "tag": "E1"},
        thing | {"type": "object_registered", "weight_g": 1, "weight_sd_g": 0},
        {"type": "object_removed", "tag": "E1"},
    ]


async def test_a_product_changes_all_its_objects_in_all_rooms(town: httpx.AsyncClient, registry: Registry) -> None:
    await put(town, "E1", jan=TEA, room="lab")
    await put(town, "E2", jan=TEA, room="kitchen", weight_g=1)
    await put(town, "E3", jan=TEA, room="kitchen", size_m=1)
    await put(town, "E4", jan=TEA)
    assert (await town.put(f"/v1/products/{TEA}", json={"name": "tea", "weight_g": 480})).status_code == 200
    assert [r["tag"] for r in await registry("lab") if r["type"] == "object_changed"] == ["E1"]
    assert [r["tag"] for r in await registry("kitchen") if r["type"] == "object_changed"] == ["E2", "E3"]


async def test_patch_keeps_the_absent_and_clears_null(town: httpx.AsyncClient) -> None:
    whole = {
        "name": "a",
        "synonyms": ["s"],
        "jan": TEA,
        "size_m": [1.0, 1.0, 1.0],
        "weight_g": 1.0,
        "weight_sd_g": 1.0,
        "category": "c",
        "room": "lab",
        "tracking": "map",
        "tag_pose": [1.0, 2.0, 3.0],
        "user_memory": "ab",
    }
    changes = {
        "name": "b",
        "synonyms": ["t", "u"],
        "size_m": [2.0, 2.0, 2.0],
        "weight_g": 0.0,
        "weight_sd_g": 0.0,
        "category": "d",
        "room": "kitchen",
        "tracking": "placement",
        "tag_pose": [0.0, 0.0, 0.0],
        "user_memory": "",
    }
    cleared = {"synonyms": [], "tracking": "placement"}
    tea = (await town.get(f"/v1/products/{TEA}")).json()
    loop = asyncio.get_running_loop()

    async def check(change: list[str], clear: list[str]) -> None:
        await put(town, **whole)
        patch = {name: changes[name] for name in change} | dict.fromkeys(clear)
        answer = await town.patch("/v1/objects/E1", json=patch)
        assert answer.status_code == 200, answer.text
        expected = whole | {n: changes[n] for n in change} | {n: cleared.get(n) for n in clear}
        if expected["jan"] is not None:
            if expected["weight_g"] is None:
                expected["weight_g"] = tea["weight_g"]
                expected["weight_sd_g"] = 4 if expected["weight_sd_g"] is None else expected["weight_sd_g"]
            expected["category"] = expected["category"] or tea["category"]
            expected["size_m"] = expected["size_m"] or tea["size_m"]
        found = answer.json()
        assert {name: found[name] for name in expected} == expected

    fields = st.lists(st.sampled_from(sorted(changes)), unique=True)
    clearable = st.lists(st.sampled_from(sorted(whole.keys() - {"name"})), unique=True)

    @settings(max_examples=25)
    @given(fields, clearable)
    def law(change: list[str], clear: list[str]) -> None:
        asyncio.run_coroutine_threadsafe(check([n for n in change if n not in clear], clear), loop).result(60)

    await asyncio.to_thread(law)


async def test_pages_concatenated_are_the_whole_in_order(town: httpx.AsyncClient) -> None:
    tags = sorted(f"{mark}{n}" for mark in "A-Z_9.:" for n in range(5))
    for i, tag in enumerate(tags):
        await put(town, tag, room="lab" if i % 3 else None, name="odd" if i % 2 else "even")
    loop = asyncio.get_running_loop()

    async def listed(limit: int, **query: str) -> list[str]:
        seen: list[str] = []
        cursor: dict[str, str] = {}
        while True:
            page = (await town.get("/v1/objects", params=query | {"limit": str(limit)} | cursor)).json()
            assert len(page["items"]) <= limit
            seen += [item["tag"] for item in page["items"]]
            if page["next_cursor"] is None:
                return seen
            cursor = {"cursor": page["next_cursor"]}

    expected = {
        (): tags,
        (("room", "lab"),): [t for i, t in enumerate(tags) if i % 3],
        (("q", "ODD"),): [t for i, t in enumerate(tags) if i % 2],
        (("q", "odd"), ("room", "lab")): [t for i, t in enumerate(tags) if i % 2 and i % 3],
    }

    @settings(max_examples=20)
    @given(st.integers(1, 50), st.sampled_from(sorted(expected)))
    def law(limit: int, query: tuple[tuple[str, str], ...]) -> None:
        found = asyncio.run_coroutine_threadsafe(listed(limit, **dict(query)), loop).result(60)
        assert found == expected[query]

    await asyncio.to_thread(law)


async def test_a_page_goes_on_where_it_stopped_though_things_come_and_go(town: httpx.AsyncClient) -> None:
    for n in range(6):
        await put(town, f"E{n}")
    first = (await town.get("/v1/objects", params={"limit": 3})).json()
    assert (await town.delete("/v1/objects/E2")).status_code == 204
    await put(town, "E00")
    rest = (await town.get("/v1/objects", params={"limit": 3, "cursor": first["next_cursor"]})).json()
    assert [item["tag"] for item in rest["items"]] == ["E3", "E4", "E5"]
    assert rest["next_cursor"] is None


async def test_deleting_forgets(town: httpx.AsyncClient) -> None:
    await put(town, room="lab")
    assert (await town.delete("/v1/objects/E1")).status_code == 204
    assert (await town.get("/v1/objects/E1")).status_code == 404
    assert (await town.delete("/v1/objects/E1")).status_code == 404
    assert (await town.patch("/v1/objects/E1", json={"name": "x"})).status_code == 404


async def test_the_model_is_the_products_shape_and_the_objects_tag_pose(town: httpx.AsyncClient) -> None:
    await put(town, jan=TEA, tag_pose=[0.1, 0.2, 0.3])
    assert (await town.get("/v1/objects/E1/model")).json() == {
        "tag": "E1",
        "class": "bottle",
        "polygon": [[0, 0], [0.06, 0], [0, 0.06]],
        "parts": [],
        "tag_pose": [0.1, 0.2, 0.3],
    }
    await put(town, "E2")
    assert "shape" in (await town.get("/v1/objects/E2/model")).json()["detail"]
    assert (await town.get("/v1/objects/E2/model")).status_code == 404
    assert (await town.get("/v1/objects/E3/model")).status_code == 404


async def test_bad_objects_are_refused_by_name(town: httpx.AsyncClient) -> None:
    cases: list[tuple[dict[str, Any], str]] = [
        ({"jan": "4901234567890"}, "jan"),
        ({"jan": "49968712"}, "jan"),  # not in the catalogue
        ({"jan": "x"}, "jan"),
        ({"room": "nowhere"}, "room"),
        ({"colour": "blue"}, "colour"),
        ({"name": "a\x00b"}, "name"),
        ({"name": " "}, "name"),
        ({"synonyms": ["ok", ""]}, "synonyms/1"),
        ({"weight_g": -1}, "weight_g"),
        ({"weight_g": 10**400}, "weight_g"),
        ({"size_m": [1, 2]}, "size_m/2"),
        ({"size_m": 0}, "size_m/0"),
        ({"user_memory": "0" * 386}, "user_memory"),
        ({"user_memory": "abc"}, "user_memory"),
        ({"tracking": "magic"}, "tracking"),
        ({"tag_pose": [0, 0]}, "tag_pose/2"),
    ]
    for fields, where in cases:
        answer = await town.put("/v1/objects/E1", json={"name": "thing"} | fields)
        assert answer.status_code == 422, (where, answer.text)
        assert where in [item["where"] for item in answer.json()["items"]], answer.text
        assert (await town.get("/v1/objects/E1")).status_code == 404
    for text in ('{"name": "\\ud800"}', '{"name": "x", "weight_g": NaN}', '{"name": "x", "weight_g": 1e999}'):
        answer = await town.put("/v1/objects/E1", content=text, headers={"Content-Type": "application/json"})
        assert answer.status_code == 422, text
    malformed = await town.put("/v1/objects/E1", content="{", headers={"Content-Type": "application/json"})
    assert malformed.status_code == 400
    await put(town)
    for patch in ({"name": None}, {"room": "nowhere"}, {"jan": "1"}, {"x": 1}):
        assert (await town.patch("/v1/objects/E1", json=patch)).status_code == 422, patch


async def test_bad_queries_are_refused(town: httpx.AsyncClient) -> None:
    bad = [
        {"limit": "0"},
        {"limit": "1001"},
        {"limit": "9" * 30},
        {"cursor": "nonsense"},
        {"cursor": ""},
        {"q": "\x00"},
        {"q": "x" * 201},
        {"category": "\x00"},
        {"room": "a b"},
        {"area": "0,0,1,1"},  # of which room?
        {"area": "0,0,1", "room": "lab"},
        {"area": "0,0,1,nan", "room": "lab"},
        {"area": "0,0,inf,1", "room": "lab"},
        {"area": "1,0,0,1", "room": "lab"},
        {"area": "0,0,1,1", "room": "lab", "min_p": "2"},
    ]
    for query in bad:
        answer = await town.get("/v1/objects", params=query)
        assert answer.status_code == 422, (query, answer.text)
    assert (await town.get("/v1/objects", params={"room": "nowhere"})).status_code == 404
    for tag in ("a b", "%00", "%FF", "x" * 65, "あ"):
        assert (await town.get(f"/v1/objects/{tag}")).status_code == 422, tag


async def test_concurrent_puts_leave_one_object(town: httpx.AsyncClient, registry: Registry) -> None:
    answers = await asyncio.gather(
        *(town.put("/v1/objects/E1", json={"name": "thing", "room": room}) for room in ["lab", "kitchen"] * 4)
    )
    assert sorted(answer.status_code for answer in answers) == [200] * 7 + [201]
    at = (await town.get("/v1/objects/E1")).json()["room"]
    for room in ("lab", "kitchen"):
        kinds = [record["type"] for record in (await registry(room))[1:]]
        registered = kinds.count("object_registered") - kinds.count("object_removed")
        assert registered == (1 if room == at else 0)


async def test_keys_see_the_objects_of_their_rooms(
    town: httpx.AsyncClient, make_key: Callable[..., Awaitable[str]]
) -> None:
    await put(town, "E1", room="lab")
    await put(town, "E2", room="kitchen")
    await put(town, "E3")
    mine = {"Authorization": f"Bearer {await make_key('read:lab')}"}
    listed = (await town.get("/v1/objects", headers=mine)).json()["items"]
    assert [item["tag"] for item in listed] == ["E1", "E3"]
    assert (await town.get("/v1/objects/E1", headers=mine)).status_code == 200
    assert (await town.get("/v1/objects/E2", headers=mine)).status_code == 403
    assert (await town.get("/v1/objects/E2/model", headers=mine)).status_code == 403
    assert (await town.get("/v1/objects", params={"room": "kitchen"}, headers=mine)).status_code == 403
    assert (await town.put("/v1/objects/E1", json={"name": "x"}, headers=mine)).status_code == 403
    assert (await town.patch("/v1/objects/E1", json={"name": "x"}, headers=mine)).status_code == 403
    assert (await town.delete("/v1/objects/E1", headers=mine)).status_code == 403
    assert (await town.get("/v1/objects/E1")).status_code == 401


async def test_registering_and_observing_at_once_never_collide(town: httpx.AsyncClient) -> None:
    """Writers of the registry and of the log lock the same rooms; none may fail or wait for ever."""

    def observed(room: str, agent: str, seq: int) -> dict[str, Any]:
        read = {"seq": seq, "observed_at": "2026-11-01T00:00:00Z", "type": "raw_read", "zone": "z", "tag": f"E{seq}"}
        return {"agent": agent, "room": room, "observations": [read]}

    rooms = ("lab", "kitchen")
    answers = await asyncio.gather(
        *(town.put(f"/v1/objects/E{n}", json={"name": "x", "jan": TEA, "room": rooms[n % 2]}) for n in range(10)),
        *(town.put(f"/v1/objects/E{n}", json={"name": "x", "jan": TEA, "room": rooms[n % 2 - 1]}) for n in range(10)),
        *(town.post("/v1/observations", json=observed(room, room, n)) for n in range(10) for room in rooms),
        *(town.put(f"/v1/products/{TEA}", json={"name": "tea", "weight_g": n}) for n in range(5)),
    )
    assert {answer.status_code for answer in answers} <= {200, 201}, [a.text for a in answers if not a.is_success]
