"""The live view against a real WebSocket server that cuts the line."""

from __future__ import annotations

import contextlib
import random

import pytest

import tms_client
from tms_client import AsyncTown, Retry, Town

NOW = "2026-11-20T10:00:00Z"
QUICK = Retry(attempts=3, first_s=0.01, cap_s=0.02, random=random.Random(1))


def snapshot(cursor: int) -> dict:
    return {"type": "snapshot", "room": "r", "cursor": cursor, "at": NOW, "objects": [], "labels": [], "movers": []}


def event(cursor: int) -> dict:
    frame = {"type": "event", "room": "r", "cursor": cursor, "agent": "a", "seq": cursor, "event": {"type": "x"}}
    return frame | {"observed_at": NOW, "received_at": NOW}


def state(cursor: int) -> dict:
    return {"type": "state", "room": "r", "cursor": cursor, "at": NOW}


async def cutting(websocket, subscribe):
    """Sends two events per connection, runs ahead with a state, repeats one event, and hangs up."""
    cursor = subscribe["cursor"]
    if cursor is None:
        cursor = 10
        await websocket.send_json(snapshot(cursor))
    else:
        await websocket.send_json(event(cursor))
    await websocket.send_json(event(cursor + 1))
    await websocket.send_json({"type": "of a later version", "cursor": 1})
    await websocket.send_json(state(cursor + 50))
    await websocket.send_json(event(cursor + 2))
    await websocket.close(1001)


def test_events_are_lossless_across_cuts(fake):
    fake.live = cutting
    cursors = []
    with Town(fake.url, retry=QUICK) as town, contextlib.closing(town.live("r")) as frames:
        first = next(frames)
        assert first.type == "snapshot"
        for frame in frames:
            if frame.type == "event":
                cursors.append(frame.cursor)
            if len(cursors) == 7:
                break
    assert cursors == list(range(11, 18))
    assert fake.sockets == 4


async def test_the_same_awaited(fake):
    fake.live = cutting
    cursors = []
    async with AsyncTown(fake.url, retry=QUICK) as town, contextlib.aclosing(town.live("r")) as frames:
        async for frame in frames:
            if frame.type == "event":
                cursors.append(frame.cursor)
            if len(cursors) == 7:
                break
    assert cursors == list(range(11, 18))


def test_resumes_at_a_given_cursor_and_passes_the_wishes_on(fake):
    seen = []

    async def record(websocket, subscribe):
        seen.append(subscribe)
        await websocket.send_json(state(5))
        await websocket.receive()

    fake.live = record
    with Town(fake.url) as town:
        wishes = {"objects": ["A1"], "events": ["label_moved"], "min_change": 0.1, "with_events": False}
        with contextlib.closing(town.live("r", cursor=4, **wishes)) as frames:
            next(frames)
    assert seen == [{"type": "subscribe", "room": "r", "cursor": 4, **wishes}]


@pytest.mark.parametrize(("status", "error"), [(403, tms_client.Forbidden), (404, tms_client.NotFound)])
def test_refusals_are_raised(fake, status, error):
    async def refuse(websocket, subscribe):
        await websocket.send_json({"type": "error", "status": status, "detail": "not for you"})

    fake.live = refuse
    with Town(fake.url) as town, pytest.raises(error, match="not for you"):
        next(town.live("r"))


def test_a_key_revoked_on_the_way(fake):
    async def revoke(websocket, subscribe):
        await websocket.send_json(snapshot(1))
        await websocket.close(1008, "key revoked")

    fake.live = revoke
    with Town(fake.url) as town, pytest.raises(tms_client.Forbidden, match="403 key revoked"):
        list(town.live("r"))


def test_no_server():
    with Town("http://127.0.0.1:9", retry=QUICK) as town, pytest.raises(tms_client.Unreachable):
        next(town.live("r"))
