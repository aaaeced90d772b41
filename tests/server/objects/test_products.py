"""Products and the catalogue import over HTTP, on both databases."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest

TEA = "4901234567894"
UPC = "036000291452"


async def test_all_forms_of_a_jan_find_the_product(town: httpx.AsyncClient) -> None:
    answer = await town.put(f"/v1/products/{UPC}", json={"name": "tissue"})
    assert answer.status_code == 201
    assert answer.json()["jan"] == "0" + UPC
    for form in (UPC, "0" + UPC, "00" + UPC):
        assert (await town.get(f"/v1/products/{form}")).json() == answer.json()
        assert (await town.put(f"/v1/products/{form}", json={"name": "tissue"})).status_code == 200
    assert len((await town.get("/v1/products")).json()["items"]) == 2


async def test_a_product_comes_back_as_it_was_put(town: httpx.AsyncClient) -> None:
    body = {
        "name": "箱",
        "size_m": [0.1, 0.2, 0.3],
        "weight_g": 12.5,
        "weight_sd_g": 0.5,
        "category": "box",
        "shape": {"class": "box", "polygon": [[0, 0], [1, 0], [0, 1]], "parts": [[[0, 0], [1, 0], [0, 1]]]},
    }
    stored = (await town.put("/v1/products/49968712", json=body)).json()
    assert stored == body | {"jan": "49968712"}
    assert (await town.get("/v1/products/0000049968712")).json() == stored


async def test_products_page_and_are_found(town: httpx.AsyncClient) -> None:
    for jan, name in (("49968712", "ボールペン"), (UPC, "Tissue"), ("10614141000415", "case of tea")):
        await town.put(f"/v1/products/{jan}", json={"name": name})
    seen: list[str] = []
    cursor: dict[str, str] = {}
    while True:
        page = (await town.get("/v1/products", params={"limit": 1} | cursor)).json()
        seen += [item["jan"] for item in page["items"]]
        if page["next_cursor"] is None:
            break
        cursor = {"cursor": page["next_cursor"]}
    assert seen == ["0036000291452", "10614141000415", TEA, "49968712"]
    for q, jan in (("ぼーる", "49968712"), ("TEA case", "10614141000415"), ("00036000291452", "0" + UPC)):
        assert [p["jan"] for p in (await town.get("/v1/products", params={"q": q})).json()["items"]] == [jan]


async def test_bad_products_are_refused_by_name(town: httpx.AsyncClient) -> None:
    for jan in ("4901234567890", "123", "490123456789x", "٤٩٠١٢٣٤٥٦٧٨٩٤", "00000000"):
        for answer in (
            await town.put(f"/v1/products/{jan}", json={"name": "x"}),
            await town.get(f"/v1/products/{jan}"),
        ):
            assert answer.status_code == 422
            assert answer.json()["items"][0]["where"] == "jan"
    assert "4 belongs there" in (await town.get("/v1/products/4901234567890")).json()["detail"]
    assert (await town.get("/v1/products/49968712")).status_code == 404
    flat = {"class": "x", "polygon": [[0, 0], [1, 1], [2, 2]]}
    answer = await town.put(f"/v1/products/{TEA}", json={"name": "x", "shape": flat})
    assert (answer.status_code, answer.json()["items"][0]["where"]) == (422, "shape/polygon")
    assert (await town.put(f"/v1/products/{TEA}", json={"name": "x", "jan": TEA})).status_code == 422


CATALOGUE = """JAN,name,size,weight_g,class,shape,maker
49968712,"Pen, blue",0.01x0.01x0.15,12.5,文具,,ACME
036000291452,ティッシュ,60 × 60 × 200 mm,0.5kg,紙,"[[0,0],[0.1,0],[0,0.1]]",ACME

4901234567890,wrong digit,,,,,
4901234567894,,,,飲料,,
10614141000415,,,,,,
4912345678904,big,1x2,,,,
4512345678906,heavy,,much,,,
4987654321094,shaped,,,,"[[0,0],[1,1],[2,2]]",
4976543210984,shapeless,,,box,"[[0,0],",
4965432109874,long,,,,,,more
036000291452,other tissue,,,,,
"""


async def load(town: httpx.AsyncClient, body: bytes) -> dict[str, Any]:
    answer = await town.post("/v1/catalogue", content=body, headers={"Content-Type": "text/csv"})
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp932"])
async def test_good_rows_are_stored_and_bad_ones_named(town: httpx.AsyncClient, encoding: str) -> None:
    result = await load(town, CATALOGUE.replace("\n", "\r\n").encode(encoding))
    assert result["stored"] == 3
    assert result["ignored_columns"] == ["maker"]
    refused = {problem["line"]: problem["reason"] for problem in result["refused"]}
    parts = {
        5: "check digit",
        7: "name",
        8: "size",
        9: "weight",
        10: "class",
        11: "not JSON",
        12: "8 cells",
        13: "line 3",
    }
    assert refused.keys() == parts.keys()
    for line, part in parts.items():
        assert part in refused[line], (line, refused[line])
    tissue = (await town.get("/v1/products/036000291452")).json()
    assert tissue == {
        "jan": "0036000291452",
        "name": "ティッシュ",
        "size_m": [0.06, 0.06, 0.2],
        "weight_g": 500,
        "weight_sd_g": None,
        "category": "紙",
        "shape": {"class": "紙", "polygon": [[0, 0], [0.1, 0], [0, 0.1]], "parts": []},
    }
    assert (await town.get("/v1/products/49968712")).json()["name"] == "Pen, blue"
    tea = (await town.get(f"/v1/products/{TEA}")).json()
    assert (tea["name"], tea["category"], tea["weight_g"]) == ("お茶 500ml", "飲料", 520)  # empty cells keep


async def test_importing_again_changes_nothing(
    town: httpx.AsyncClient, registry: Callable[[str], Awaitable[list[dict[str, Any]]]]
) -> None:
    await town.put("/v1/objects/E1", json={"name": "x", "room": "lab", "jan": TEA})
    body = f"商品名,ＪＡＮコード,重量(g)\n緑茶,{TEA},300\n".encode()
    for _ in range(2):
        assert await load(town, body) == {"stored": 1, "refused": [], "ignored_columns": []}
    assert [record["type"] for record in (await registry("lab"))[1:]] == ["object_registered", "object_changed"]
    assert (await town.get("/v1/objects/E1")).json()["weight_g"] == 300


async def test_many_rows(town: httpx.AsyncClient) -> None:
    from tms_server.objects.gtin import InvalidGtin, canonical_gtin

    def valid(payload: str) -> str:
        for digit in "0123456789":
            try:
                return canonical_gtin(payload + digit)
            except InvalidGtin:
                continue
        raise AssertionError

    rows = [f"{valid(f'45{n:010}')},product {n}" for n in range(1, 2001)]
    assert (await load(town, "\n".join(["jan,name", *rows]).encode()))["stored"] == 2000
    assert len((await town.get("/v1/products", params={"limit": 1000})).json()["items"]) == 1000


async def test_what_is_no_catalogue_is_refused(town: httpx.AsyncClient) -> None:
    for body in (
        b"",
        b"a,b\n1,2\n",
        b"jan\n49968712\n",
        b"jan,jan,name\n",
        b"\x81",
        b"\xff\xfe\x00\x01",
        b'"jan,name\n',
    ):
        answer = await town.post("/v1/catalogue", content=body, headers={"Content-Type": "text/csv"})
        assert answer.status_code == 422, body


async def test_an_open_quote_loses_nothing_silently(town: httpx.AsyncClient) -> None:
    result = await load(town, b'jan,name\n49968712,"pen\n036000291452,tissue\n')
    assert result["stored"] == 0
    assert [problem["line"] for problem in result["refused"]] == [2]
    assert "line 3" in result["refused"][0]["reason"]
    result = await load(town, b"jan,name\n49968712,pe\x00n\n036000291452,tissue\n")
    assert (result["stored"], [problem["line"] for problem in result["refused"]]) == (1, [2])


async def test_only_an_administrator_writes_products(
    town: httpx.AsyncClient, make_key: Callable[..., Awaitable[str]]
) -> None:
    mine = {"Authorization": f"Bearer {await make_key('observe:*', 'read:*')}"}
    assert (await town.get(f"/v1/products/{TEA}", headers=mine)).status_code == 200
    assert (await town.get("/v1/products", headers=mine)).status_code == 200
    assert (await town.put(f"/v1/products/{TEA}", json={"name": "x"}, headers=mine)).status_code == 403
    assert (await town.post("/v1/catalogue", content=b"jan,name\n", headers=mine)).status_code == 403
    assert (await town.get("/v1/products")).status_code == 401
