"""Intake and the list of unknown tags, on both databases."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import httpx

See = Callable[..., Awaitable[None]]
MakeKey = Callable[..., Awaitable[str]]
Registry = Callable[[str], Awaitable[list[dict[str, Any]]]]
TEA = "4901234567894"
#: The example of the GS1 Tag Data Standard: GTIN 80614141123458, serial 6789.
SGTIN = "3074257BF7194E4000001A85"
#: urn:epc:id:sgtin:4901777.101868.123, a packing (indicator 1) of JAN 4901777018686.
PACKING = "30352B2E44637B000000007B"
#: urn:epc:id:sgtin:490177.0701868.77: decodes to a GTIN, but its company prefix has the wrong length.
MADE_UP, MADE_UP_GTIN = "3039DEB042AD6B000000004D", "4901777018686"


async def intake(town: httpx.AsyncClient, tag: str = "E1", **body: Any) -> httpx.Response:
    return await town.post("/v1/intake", json={"tag": tag} | body)


async def unknown(town: httpx.AsyncClient, **query: Any) -> list[tuple[str, str]]:
    answer = await town.get("/v1/unknown-tags", params=query)
    assert answer.status_code == 200, answer.text
    return [(item["tag"], item["room"]) for item in answer.json()["items"]]


async def test_tag_and_jan_fill_everything(town: httpx.AsyncClient) -> None:
    answer = await intake(town, "e1", jan=TEA, room="lab")
    assert answer.status_code == 201
    body = answer.json()
    assert body["created"] is True
    assert body["product"]["jan"] == TEA
    found = body["object"]
    assert (found["tag"], found["name"], found["weight_g"], found["room"]) == ("E1", "お茶 500ml", 520, "lab")
    assert (await town.get("/v1/objects/E1")).json() == found


async def test_an_sgtin_tag_alone_is_enough(town: httpx.AsyncClient) -> None:
    await town.put("/v1/products/80614141123458", json={"name": "case of pens"})
    answer = await intake(town, SGTIN)
    assert answer.status_code == 201
    assert answer.json()["object"]["name"] == "case of pens"
    assert answer.json()["object"]["jan"] == "80614141123458"
    contradicting = await intake(town, SGTIN, jan=TEA)
    assert contradicting.status_code == 422
    assert "80614141123458" in contradicting.json()["detail"]


async def test_a_tag_of_a_packing_is_not_the_thing_in_it(town: httpx.AsyncClient) -> None:
    await town.put("/v1/products/14901777018683", json={"name": "24 bottles of tea", "weight_g": 12_900})
    await town.put("/v1/products/4901777018686", json={"name": "tea", "weight_g": 525})
    answer = await intake(town, PACKING)
    assert (answer.json()["object"]["name"], answer.json()["object"]["weight_g"]) == ("24 bottles of tea", 12_900)
    scanned = await intake(town, PACKING[:-1] + "0", jan="4901777018686")
    assert scanned.status_code == 422 and "packing level 1" in scanned.json()["detail"]


async def test_a_number_made_up_is_not_taken_for_a_product(town: httpx.AsyncClient) -> None:
    """A laboratory's EPC that happens to decode: it neither names a product nor contradicts the scanner."""
    alone = await intake(town, MADE_UP)
    assert alone.status_code == 422 and "of no known company" in alone.json()["detail"]
    assert (await intake(town, MADE_UP, jan=TEA)).status_code == 201
    assert (await town.get("/v1/products", params={"q": ""})).json()["items"][0]["jan"] == TEA


async def test_a_made_up_number_that_is_in_the_catalogue_is_trusted(town: httpx.AsyncClient) -> None:
    await town.put(f"/v1/products/{MADE_UP_GTIN}", json={"name": "our own box"})
    assert (await intake(town, MADE_UP)).json()["object"]["name"] == "our own box"
    assert (await intake(town, MADE_UP[:-1] + "0", jan=TEA)).status_code == 422


async def test_an_in_store_number_is_nobodys_product(town: httpx.AsyncClient) -> None:
    shop = "2012345000018"
    assert (await intake(town, "E1", jan=shop)).status_code == 422
    answer = await intake(town, "E1", jan=shop, name="小松菜")
    assert answer.status_code == 201
    assert (answer.json()["object"]["name"], answer.json()["object"]["jan"]) == ("小松菜", None)
    assert (await town.get(f"/v1/products/{shop}")).status_code == 404
    assert (await intake(town, "E1", jan=shop, name="小松菜")).status_code == 200
    await town.put(f"/v1/products/{shop}", json={"name": "our bread"})  # said on purpose
    assert (await intake(town, "E2", jan=shop)).json()["object"]["name"] == "our bread"


async def test_again_is_no_change_and_otherwise_a_conflict(town: httpx.AsyncClient, registry: Registry) -> None:
    first = await intake(town, jan=TEA, room="lab")
    for again in ({"jan": TEA, "room": "lab"}, {"jan": "0" + TEA}, {"name": "お茶 500ml"}):
        answer = await intake(town, **again)
        assert answer.status_code == 200, answer.text
        assert answer.json()["created"] is False
        assert answer.json()["object"] == first.json()["object"]
    await town.put("/v1/products/49968712", json={"name": "pen"})
    for other, where in (
        ({"jan": "49968712"}, "jan"),
        ({"jan": TEA, "room": "kitchen"}, "room"),
        ({"jan": TEA, "name": "coffee"}, "name"),
    ):
        answer = await intake(town, **other)
        assert answer.status_code == 409, answer.text
        assert [item["where"] for item in answer.json()["items"]] == [where]
    assert (await town.get("/v1/objects/E1")).json() == first.json()["object"]
    assert len(await registry("lab")) == 2


async def test_gaps_of_a_registered_object_are_filled(town: httpx.AsyncClient) -> None:
    await town.put("/v1/objects/E1", json={"name": "tea"})
    answer = await intake(town, jan=TEA, room="lab", synonyms=["drink"])
    assert (answer.status_code, answer.json()["created"]) == (200, False)
    found = answer.json()["object"]
    assert (found["name"], found["jan"], found["room"], found["synonyms"]) == ("tea", TEA, "lab", ["drink"])


async def test_what_cannot_be_registered_says_how_to_go_on(town: httpx.AsyncClient) -> None:
    for body, part in (
        ({}, "name"),
        ({"jan": "49968712"}, "PUT /v1/products/49968712"),
        ({"jan": "4901234567890"}, "check digit"),
        ({"jan": TEA, "room": "nowhere"}, "nowhere"),
        ({"name": "x", "colour": "blue"}, "colour"),
    ):
        answer = await intake(town, **body)
        assert answer.status_code == 422, answer.text
        assert part in answer.json()["detail"]
        assert (await town.get("/v1/objects/E1")).status_code == 404
    assert (await intake(town, "", name="x")).status_code == 422


async def test_a_name_adds_an_unknown_product(town: httpx.AsyncClient) -> None:
    assert (await intake(town, "E1", jan="49968712", name="pen")).status_code == 201
    assert (await town.get("/v1/products/49968712")).json()["name"] == "pen"
    assert (await intake(town, "E2", jan="49968712")).json()["object"]["name"] == "pen"
    assert (await intake(town, "E3", name="cup")).json()["object"]["jan"] is None


async def test_the_room_is_where_the_tag_was_seen_if_that_is_one(
    town: httpx.AsyncClient, see: See, registry: Registry
) -> None:
    await see("E1", "lab")
    await see("E2", "lab")
    await see("E2", "kitchen")
    assert (await intake(town, "E1", jan=TEA)).json()["object"]["room"] == "lab"
    assert (await intake(town, "E2", jan=TEA)).json()["object"]["room"] is None
    assert (await intake(town, "E3", jan=TEA)).json()["object"]["room"] is None
    assert [record.get("tag") for record in await registry("lab")] == [None, "E1"]


async def test_unknown_tags_are_listed_until_they_are_registered(town: httpx.AsyncClient, see: See) -> None:
    await see("E2", "lab", count=7, first=1_500_000, last=61_000_000)
    await see("E1", "lab")
    await see("E1", "kitchen")
    listed = (await town.get("/v1/unknown-tags")).json()["items"]
    assert listed[2] == {
        "tag": "E2",
        "room": "lab",
        "agent": "hand",
        "first_seen": "1970-01-01T00:00:01.500000Z",
        "last_seen": "1970-01-01T00:01:01Z",
        "count": 7,
        "label": None,
        "xy": [1.0, 2.0],
    }
    assert await unknown(town) == [("E1", "kitchen"), ("E1", "lab"), ("E2", "lab")]
    assert await unknown(town, room="lab") == [("E1", "lab"), ("E2", "lab")]
    assert (await intake(town, "E1", jan=TEA, room="lab")).status_code == 201
    assert await unknown(town) == [("E2", "lab")]
    await town.put("/v1/objects/E2", json={"name": "x", "room": "lab"})
    assert await unknown(town) == []
    assert (await town.get("/v1/unknown-tags", params={"room": "nowhere"})).status_code == 404


async def test_unknown_tags_page(town: httpx.AsyncClient, see: See) -> None:
    seen = [(tag, room) for tag in ("A", "B", "C.1", "C_1") for room in ("kitchen", "lab")]
    for tag, room in seen:
        await see(tag, room)
    for limit in (1, 2, 3, 5, 8, 9):
        found: list[tuple[str, str]] = []
        cursor: dict[str, str] = {}
        while True:
            page = (await town.get("/v1/unknown-tags", params={"limit": limit} | cursor)).json()
            found += [(item["tag"], item["room"]) for item in page["items"]]
            if page["next_cursor"] is None:
                break
            cursor = {"cursor": page["next_cursor"]}
        assert found == seen
    objects = (await town.get("/v1/rooms", params={"limit": 1})).json()["next_cursor"]
    assert (await town.get("/v1/unknown-tags", params={"cursor": objects})).status_code == 422


async def test_keys_take_in_where_they_may_observe(town: httpx.AsyncClient, see: See, make_key: MakeKey) -> None:
    await see("E1", "lab")
    await see("E1", "kitchen")
    await town.put("/v1/objects/E9", json={"name": "x", "room": "kitchen"})
    mine = {"Authorization": f"Bearer {await make_key('observe:lab')}"}

    async def status(**body: Any) -> int:
        return (await town.post("/v1/intake", json={"jan": TEA} | body, headers=mine)).status_code

    assert await status(tag="E2", room="kitchen") == 403
    assert await status(tag="E2") == 403  # no room: for administrators
    assert await status(tag="E9", room="lab") == 403
    assert await status(tag="E9") == 403
    listed = (await town.get("/v1/unknown-tags", headers=mine)).json()["items"]
    assert [item["room"] for item in listed] == ["lab"]
    assert (await town.get("/v1/unknown-tags", params={"room": "kitchen"}, headers=mine)).status_code == 403
    assert await status(tag="E1") == 201  # seen in two rooms, of which the key may observe one
    assert await status(tag="E3", room="lab") == 201
    reader = {"Authorization": f"Bearer {await make_key('read:lab')}"}
    assert (
        await town.post("/v1/intake", json={"tag": "E4", "jan": TEA, "room": "lab"}, headers=reader)
    ).status_code == 403
