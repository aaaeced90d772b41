"""What is no observation gets an answer that says why, and leaves nothing behind."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

MOVE = {"seq": 7, "observed_at": "2026-05-01T10:00:00Z", "type": "label_moved", "label": "cab/1", "xy": [1, 2]}


def raw(observation: dict[str, Any] | str) -> bytes:
    text = observation if isinstance(observation, str) else json.dumps(observation)
    return f'{{"agent": "cab", "room": "lab", "observations": [{json.dumps(MOVE)}, {text}]}}'.encode()


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b'{"agent": "cab"', b"\xff\xfe", b"[" * 100_000, raw('{"seq": 8,}'), b'{"agent": "\\ud800"}'],
    ids=["nothing", "cut", "cut later", "no UTF-8", "deep", "trailing comma", "half a surrogate"],
)
async def test_what_is_no_json_is_400(http: httpx.AsyncClient, post, body: bytes) -> None:
    answer = await http.post("/v1/observations", content=body)
    assert answer.status_code == 400, answer.text
    assert "not JSON" in answer.json()["detail"]


@pytest.mark.parametrize(
    "change",
    [
        {"type": "teleported"},
        {"type": "tick"},
        {"type": None},
        {"colour": "red"},
        {"xy": [1]},
        {"xy": [1e300, 0]},
        {"xy": None},
        {"label": ""},
        {"label": "cab/\x00"},
        {"label": "other/1"},
        {"label": "cab/"},
        {"observed_at": "2026-05-01T10:00:00"},
        {"observed_at": "yesterday"},
        {"observed_at": "0001-01-01T00:00:00+14:00"},
        {"cov": [1, 0]},
    ],
    ids=str,
)
async def test_a_bad_item_is_named_by_index_and_seq(http: httpx.AsyncClient, post, change: dict[str, Any]) -> None:
    answer = await http.post("/v1/observations", content=raw({**MOVE, "seq": 8, **change}))
    assert answer.status_code == 422, answer.text
    items = answer.json()["items"]
    assert {(item["index"], item["seq"]) for item in items} == {(1, 8)}
    assert (await post(MOVE)).json()["accepted"] == 1


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
async def test_coordinates_are_finite(http: httpx.AsyncClient, post, number: str) -> None:
    body = raw(json.dumps({**MOVE, "seq": 8}).replace("[1, 2]", f"[1, {number}]"))
    answer = await http.post("/v1/observations", content=body)
    assert answer.status_code in (400, 422), answer.text


@pytest.mark.parametrize("seq", [-1, 2**63 - 1, 1.5, "8", None, True])
async def test_a_number_that_is_none(http: httpx.AsyncClient, post, seq: object) -> None:
    answer = await http.post("/v1/observations", content=raw({**MOVE, "seq": seq}))
    assert answer.status_code == 422
    assert answer.json()["items"][0]["index"] == 1


async def test_the_largest_number_is_taken(http: httpx.AsyncClient, post) -> None:
    assert (await post({**MOVE, "seq": 2**63 - 2})).json()["accepted"] == 1
    assert (await http.get("/v1/agents/cab")).json()["next_seq"] == 2**63 - 1


@pytest.mark.parametrize(
    "batch",
    [
        {"agent": "cab", "room": "lab", "observations": []},
        {"agent": "@lab", "room": "lab", "observations": [MOVE]},
        {"agent": "cab", "room": "lab", "observations": [MOVE], "extra": 1},
        {"agent": "cab", "room": "lab", "observations": [{**MOVE, "seq": n} for n in range(1001)]},
        [],
        "text",
    ],
    ids=["empty", "a registry's name", "extra field", "too many", "a list", "a text"],
)
async def test_a_bad_batch_is_422(http: httpx.AsyncClient, post, batch: object) -> None:
    assert (await http.post("/v1/observations", json=batch)).status_code == 422


async def test_an_unknown_room_is_404(post) -> None:
    answer = await post(MOVE, room="attic")
    assert answer.status_code == 404
    assert "attic" in answer.json()["detail"]


async def test_a_hundred_megabytes_are_refused_unread(http: httpx.AsyncClient, post) -> None:
    sent = 0

    async def flood() -> AsyncIterator[bytes]:
        nonlocal sent
        for _ in range(100):
            sent += 1
            yield b" " * 1_000_000

    answer = await http.post("/v1/observations", content=flood())
    assert answer.status_code == 413
    declared = await http.post("/v1/observations", content=b"", headers={"content-length": "100000000"})
    assert declared.status_code == 413


async def test_text_that_databases_dislike_is_kept_as_it_is(http: httpx.AsyncClient, post) -> None:
    odd = {**MOVE, "surface": "棚/上段 \x00 '; drop table log; --"}
    assert (await post(odd)).json()["accepted"] == 1
    assert (await post(odd)).json()["duplicates"] == 1


async def test_who_goes_away_in_the_middle_of_a_body_is_no_fault_of_the_server(
    app: FastAPI, http: httpx.AsyncClient, caplog: pytest.LogCaptureFixture
) -> None:
    begun = {"type": "http.request", "body": b'{"agent": "cab"', "more_body": True}
    arriving = iter([begun, {"type": "http.disconnect"}])
    said: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return next(arriving)

    async def send(message: dict[str, Any]) -> None:
        said.append(message)

    scope = {
        "type": "http", "http_version": "1.1", "method": "POST", "scheme": "http", "path": "/v1/observations",
        "raw_path": b"/v1/observations", "query_string": b"", "root_path": "", "headers": [(b"host", b"127.0.0.1")],
        "client": ("127.0.0.1", 50000), "server": ("127.0.0.1", 80),
    }  # fmt: skip
    await app.with_state(scope, receive, send)  # type: ignore[attr-defined]
    assert said[0]["status"] == 400 and caplog.records == []
    assert (await http.get("/readyz")).status_code == 200
