"""Viewers side by side on one feed: who does not drain is cut, the others notice nothing."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from conftest import client, running

from tms_schemas.live import Subscribe
from tms_server.app import create_app
from tms_server.errors import Unavailable
from tms_server.live.feed import Feeds
from tms_server.live.viewer import TooSlow, Viewer
from tms_server.settings import Settings


@pytest.fixture
async def lab(tmp_path: Path) -> AsyncIterator[tuple[httpx.AsyncClient, Feeds]]:
    app = create_app(Settings(data_dir=tmp_path))
    async with app.router.lifespan_context(app) as state:
        assert state is not None

        async def with_state(scope: Any, receive: Any, send: Any) -> None:
            scope.setdefault("state", {}).update(state)
            await app(scope, receive, send)

        transport = httpx.ASGITransport(app=with_state, client=("127.0.0.1", 50000))
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as http:
            outline = [[0, 0], [6, 0], [6, 5], [0, 5]]
            (await http.put("/v1/rooms/lab", json={"name": "Lab", "outline": outline})).raise_for_status()
            yield http, state["feeds"]


async def test_a_viewer_that_does_not_drain_is_cut_and_the_others_go_on(
    lab: tuple[httpx.AsyncClient, Feeds],
) -> None:
    http, feeds = lab
    got: list[dict[str, Any]] = []

    async def stuck(_: str) -> None:
        await asyncio.Event().wait()

    async def take(text: str) -> None:
        got.append(json.loads(text))

    async with feeds.watch("lab") as feed:
        slow = asyncio.ensure_future(Viewer(feed, Subscribe(room="lab"), stuck, send_s=0.5).run())
        quick = asyncio.ensure_future(Viewer(feed, Subscribe(room="lab"), take).run())
        await eventually(lambda: got)
        for i in range(20):
            head = await step(http, i)
        with pytest.raises(TooSlow):
            await slow
        await eventually(lambda: got[-1]["cursor"] == head)
        quick.cancel()
        await asyncio.gather(quick, return_exceptions=True)
    assert got[0]["type"] == "snapshot"
    assert [one["seq"] for one in got if one["type"] == "event"] == list(range(20))


async def test_a_slow_viewer_skips_states_but_no_event(lab: tuple[httpx.AsyncClient, Feeds]) -> None:
    http, feeds = lab
    got: list[dict[str, Any]] = []

    async def slowly(text: str) -> None:
        got.append(json.loads(text))
        if got[-1]["type"] == "state":
            await asyncio.sleep(0.5)

    async with feeds.watch("lab") as feed:
        viewer = asyncio.ensure_future(Viewer(feed, Subscribe(room="lab"), slowly).run())
        await eventually(lambda: got)
        for i in range(60):
            head = await step(http, i)
        await eventually(lambda: got[-1]["cursor"] == head and got[-1]["type"] == "state")
        viewer.cancel()
        await asyncio.gather(viewer, return_exceptions=True)
    assert [one["seq"] for one in got if one["type"] == "event"] == list(range(60))
    states = [one for one in got if one["type"] == "state"]
    assert len(states) < 30
    assert states[-1]["movers"][0]["xy"] == [59 / 100, 1.0]


async def test_viewers_with_one_filter_share_the_encoded_frame(lab: tuple[httpx.AsyncClient, Feeds]) -> None:
    http, feeds = lab
    got: list[list[str]] = [[], []]
    async with feeds.watch("lab") as feed:

        async def first(text: str) -> None:
            got[0].append(text)

        async def second(text: str) -> None:
            got[1].append(text)

        viewers = [asyncio.ensure_future(Viewer(feed, Subscribe(room="lab"), one).run()) for one in (first, second)]
        await eventually(lambda: all(got))
        await step(http, 0)
        await eventually(lambda: all(len(one) == 3 for one in got))
        for viewer in viewers:
            viewer.cancel()
        await asyncio.gather(*viewers, return_exceptions=True)
    assert all(a is b for a, b in zip(got[0], got[1], strict=True))


async def test_too_many_viewers_are_refused(tmp_path: Path) -> None:
    app = create_app(Settings(data_dir=tmp_path))
    async with running(app), client(app) as http:
        outline = [[0, 0], [6, 0], [6, 5], [0, 5]]
        (await http.put("/v1/rooms/lab", json={"name": "Lab", "outline": outline})).raise_for_status()
        feeds = Feeds(None, max_viewers=0)  # type: ignore[arg-type]  # refused before the town is asked
        with pytest.raises(Unavailable):
            async with feeds.watch("lab"):
                pass


async def step(http: httpx.AsyncClient, i: int) -> int:
    event = {"type": "label_moved"} if i else {"type": "mover_entered"}
    one = {"seq": i, "observed_at": f"2026-01-01T00:00:{i:02d}Z", "label": "floor/1", "xy": [i / 100, 1], **event}
    answer = await http.post("/v1/observations", json={"agent": "floor", "room": "lab", "observations": [one]})
    answer.raise_for_status()
    return int(answer.json()["head"])


async def eventually(true: Any, timeout_s: float = 10.0) -> None:
    async with asyncio.timeout(timeout_s):
        while not true():
            await asyncio.sleep(0.02)
