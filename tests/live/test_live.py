"""``WS /v1/live`` of a real server: snapshot first, events without loss, states latest-wins, keys that end."""

from __future__ import annotations

import json
import random
import re
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import httpx
import pytest
from pydantic import TypeAdapter
from server_process import ServerProcess
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from tms_schemas.live import ErrorFrame, EventFrame, Frame, SnapshotFrame, StateFrame

ZERO = datetime(2026, 1, 1, tzinfo=UTC)
FRAME: TypeAdapter[Frame] = TypeAdapter(Frame)
TEA, MUG = "E004015000000001", "E004015000000002"


class Room:
    """A room of its own on the server, and agents that post into it."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.id = f"r{uuid.uuid4().hex[:12]}"
        self.http = httpx.Client(base_url=url, timeout=30)
        outline = [[0, 0], [6, 0], [6, 5], [0, 5]]
        self.http.put(f"/v1/rooms/{self.id}", json={"name": "Lab", "outline": outline}).raise_for_status()
        self._seq: dict[str, int] = {}

    def register(self, tag: str, name: str) -> None:
        self.http.put(f"/v1/objects/{tag}", json={"name": name, "room": self.id}).raise_for_status()

    def post(self, agent: str, second: float, **event: Any) -> int:
        """Returns the log's newest offset."""
        agent = f"{agent}-{self.id}"
        seq = self._seq[agent] = self._seq.get(agent, -1) + 1
        if "label" in event:
            event["label"] = f"{agent}/{event['label']}"
        one = {"seq": seq, "observed_at": (ZERO + timedelta(seconds=second)).isoformat(), **event}
        body = {"agent": agent, "room": self.id, "observations": [one]}
        answer = self.http.post("/v1/observations", json=body)
        answer.raise_for_status()
        return int(answer.json()["head"])

    @contextmanager
    def live(self, *, key: str | None = None, **wanted: Any) -> Iterator[ClientConnection]:
        query = urlencode({"room": self.id, **wanted}, doseq=True)
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        address = self.url.replace("http", "ws", 1)
        with connect(
            f"{address}/v1/live?{query}", additional_headers=headers, max_size=None, close_timeout=0.2
        ) as socket:
            yield socket


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    with ServerProcess(tmp_path_factory.mktemp("live")) as server:
        yield server


@pytest.fixture
def room(server: ServerProcess) -> Iterator[Room]:
    room = Room(server.url)
    yield room
    for tag in (TEA, MUG):
        room.http.delete(f"/v1/objects/{tag}")
    room.http.close()


def frame(socket: ClientConnection, timeout: float = 10.0) -> Frame:
    return FRAME.validate_json(socket.recv(timeout))


def until(socket: ClientConnection, wanted: Callable[[Frame], bool]) -> list[Frame]:
    """Frames up to the first one that is wanted."""
    frames = [frame(socket)]
    while not wanted(frames[-1]):
        frames.append(frame(socket))
    return frames


def test_a_snapshot_comes_first_then_what_changes(room: Room) -> None:
    room.register(TEA, "Tea bottle")
    head = room.post("cabinet", 1, type="label_appeared", label=1, kind="cabinet", xy=[1, 1], tag=TEA)
    with room.live() as socket:
        first = frame(socket)
        assert isinstance(first, SnapshotFrame)
        assert first.cursor == head
        assert [one.tag for one in first.objects] == [TEA]
        assert [one.label for one in first.labels] == [f"cabinet-{room.id}/1"]
        head = room.post("floor", 2, type="mover_entered", label=1, xy=[1, 2])
        event, state = frame(socket), frame(socket)
        assert isinstance(event, EventFrame)
        assert (event.cursor, event.seq, event.agent) == (head, 0, f"floor-{room.id}")
        assert event.event == {"type": "mover_entered", "label": f"floor-{room.id}/1", "xy": [1.0, 2.0]}
        assert event.observed_at == ZERO + timedelta(seconds=2)
        assert isinstance(state, StateFrame)
        assert (state.cursor, [one.label for one in state.movers]) == (head, [f"floor-{room.id}/1"])
        room.post("cabinet", 3, type="label_vanished", label=1)
        state = until(socket, lambda one: isinstance(one, StateFrame))[-1]
        assert isinstance(state, StateFrame)
        assert state.labels_gone == [f"cabinet-{room.id}/1"]
        (tea,) = state.objects
        assert tea.distribution[0].label == f"floor-{room.id}/1"


def test_the_first_message_may_say_what_is_wanted(room: Room) -> None:
    address = room.url.replace("http", "ws", 1)
    with connect(f"{address}/v1/live") as socket:
        socket.send(json.dumps({"type": "subscribe", "room": room.id}))
        assert isinstance(frame(socket), SnapshotFrame)


def test_a_late_arrival_shows_what_it_changed(room: Room) -> None:
    room.register(TEA, "Tea bottle")
    room.post("cabinet", 1, type="label_appeared", label=1, kind="cabinet", xy=[1, 1], tag=TEA)
    room.post("cabinet", 5, type="label_vanished", label=1)
    with room.live(with_events=False) as socket:
        first = frame(socket)
        assert isinstance(first, SnapshotFrame)
        assert first.objects[0].distribution[0].label == "OUT"
        room.post("floor", 3, type="mover_entered", label=1, xy=[1, 1.5])
        state = frame(socket)
        assert isinstance(state, StateFrame)
        assert state.objects[0].distribution[0].label == f"floor-{room.id}/1"


def test_events_are_lossless_under_forced_disconnects(room: Room) -> None:
    count = 400
    start = room.post("floor", 0, type="mover_entered", label=1, xy=[0, 0])

    def walk() -> None:
        for i in range(1, count + 1):
            room.post("floor", i * 0.1, type="label_moved", label=1, xy=[i / 100, 1])

    walker = threading.Thread(target=walk)
    walker.start()
    rng = random.Random(5)
    cursor, seen, connections = start, [start], 0
    while seen[-1] < start + count:
        connections += 1
        with room.live(cursor=cursor) as socket:
            for _ in range(rng.randint(1, 40)):
                one = frame(socket)
                if isinstance(one, EventFrame):
                    seen.append(one.cursor)
                # Any frame's cursor is a place to go on from.
                assert not isinstance(one, ErrorFrame)
                cursor = one.cursor
                if cursor >= start + count:
                    break
            if rng.random() < 0.5:
                socket.socket.close()  # without a word
    walker.join()
    assert connections > 5
    assert seen == list(range(start, start + count + 1))


def test_an_unknown_cursor_begins_anew(room: Room) -> None:
    head = room.post("floor", 0, type="mover_entered", label=1, xy=[0, 0])
    with room.live(cursor=head + 1_000_000) as socket:
        first = frame(socket)
        assert isinstance(first, SnapshotFrame)
        assert first.cursor == head


def test_filters(room: Room) -> None:
    room.register(TEA, "Tea bottle")
    room.register(MUG, "Mug")
    with room.live(objects=f"{TEA.lower()}", events="label_appeared,tag_observed") as socket:
        first = frame(socket)
        assert isinstance(first, SnapshotFrame)
        assert [one.tag for one in first.objects] == [TEA]
        room.post("floor", 1, type="mover_entered", label=1, xy=[0, 0])
        room.post("cabinet", 2, type="label_appeared", label=1, kind="cabinet", xy=[1, 1], tag=MUG)
        head = room.post("cabinet", 3, type="label_appeared", label=2, kind="cabinet", xy=[2, 1], tag=TEA)
        frames = until(socket, lambda one: isinstance(one, StateFrame) and one.cursor == head)
        events = [one.event for one in frames if isinstance(one, EventFrame)]
        assert [(one["type"], one["tag"]) for one in events] == [("label_appeared", MUG), ("label_appeared", TEA)]
        assert {pie.tag for one in frames if isinstance(one, StateFrame) for pie in one.objects} == {TEA}


def test_small_changes_wait_until_they_add_up(room: Room) -> None:
    room.register(TEA, "Tea bottle")
    room.post("cabinet", 1, type="label_appeared", label=1, kind="cabinet", xy=[1, 1], tag=TEA)
    with room.live(min_change=0.9, with_events=False) as socket:
        frame(socket)
        head = 0
        for second in range(2, 6):
            head = room.post("cabinet", second, type="tag_observed", label=1, tag=TEA)
            time.sleep(0.1)
        room.post("floor", 8, type="mover_entered", label=1, xy=[1, 2])
        states = until(socket, lambda one: isinstance(one, StateFrame) and one.cursor > head)
        assert all(isinstance(one, StateFrame) and one.objects == [] for one in states)
        head = room.post("cabinet", 9, type="label_vanished", label=1)
        last = until(socket, lambda one: isinstance(one, StateFrame) and one.cursor == head)[-1]
        assert isinstance(last, StateFrame)
        assert [one.tag for one in last.objects] == [TEA]


def test_who_reads_nothing_delays_nobody(room: Room) -> None:
    room.post("floor", 0, type="mover_entered", label=1, xy=[0, 0])
    with room.live() as deaf, room.live() as socket:
        del deaf
        frame(socket)
        slowest = 0.0
        for i in range(1, 100):
            began = time.monotonic()
            head = room.post("floor", i, type="label_moved", label=1, xy=[i / 100, 1])
            until(socket, lambda one, head=head: isinstance(one, StateFrame) and one.cursor >= head)
            slowest = max(slowest, time.monotonic() - began)
        assert slowest < 3.0


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ({"room": "nowhere"}, 404),
        ({"room": "no such / name"}, 422),
        ({"objects": TEA}, 422),
        ({"min_change": "nan"}, 422),
        ({"cursor": "-1"}, 422),
        ({"cursor": "x"}, 422),
        ({"colour": "red"}, 422),
        ({"room": ["a", "b"]}, 422),
    ],
)
def test_a_bad_subscription_is_told_and_closed(server: ServerProcess, query: dict[str, Any], status: int) -> None:
    wanted = query if "room" in query or "objects" in query else {"room": "demo", **query}
    address = server.url.replace("http", "ws", 1)
    with connect(f"{address}/v1/live?{urlencode(wanted, doseq=True)}") as socket:
        assert_refused(socket, status)


@pytest.mark.parametrize("message", ["", "{", "[]", "null", '{"room": 5}', b"\xff\x00", "x" * 1_100_000])
def test_a_bad_first_message_is_told_and_closed(server: ServerProcess, message: str | bytes) -> None:
    address = server.url.replace("http", "ws", 1)
    with connect(f"{address}/v1/live") as socket:
        socket.send(message)
        assert_refused(socket, None)
    assert httpx.get(server.url + "/healthz").status_code == 200


def test_keys_are_checked_and_a_revoked_one_ends_the_view(tmp_path: Path) -> None:
    with ServerProcess(tmp_path) as server:
        room = Room(server.url)
        reader = make_key(tmp_path, f"read:{room.id}")
        stranger = make_key(tmp_path, "read:elsewhere")
        time.sleep(1.5)
        for key, status in ((None, 401), ("tms_x_y", 401), (stranger, 403)):
            with room.live(key=key) as socket:
                assert_refused(socket, status)
        with room.live(key=reader) as socket:
            assert isinstance(frame(socket), SnapshotFrame)
            tms_keys(tmp_path, "revoke", reader.split("_")[1])
            began = time.monotonic()
            assert_refused(socket, 401)
            assert time.monotonic() - began < 5.0
        room.http.close()


def assert_refused(socket: ClientConnection, status: int | None) -> None:
    refused = frame(socket)
    assert isinstance(refused, ErrorFrame)
    assert refused.detail
    assert refused.status == (status or 422)
    with pytest.raises(ConnectionClosed) as closed:
        socket.recv(5)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 4000 + refused.status


def make_key(data_dir: Path, scope: str) -> str:
    out = tms_keys(data_dir, "create", "test", "--scope", scope)
    found = re.search(r"tms_\w+", out)
    assert found is not None
    return found[0]


def tms_keys(data_dir: Path, *arguments: str) -> str:
    command = [sys.executable, "-m", "tms_client", "keys", *arguments, "--data-dir", str(data_dir)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout
