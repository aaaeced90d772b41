"""A small real HTTP and WebSocket server that can be told to misbehave."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import Any

import pytest
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

Reply = tuple[int, dict[str, str], Any]


class FakeTown:
    """Keeps observations by (agent, seq) as the real one does; ``script`` overrides the next answers."""

    def __init__(self) -> None:
        self.url = ""
        self.script: deque[Reply] = deque()
        self.pages: dict[str, Any] = {}
        self.requests: list[tuple[str, str, dict[str, str], bytes]] = []
        self.records: dict[tuple[str, int], dict[str, Any]] = {}
        self.refuse: Callable[[dict[str, Any]], str | None] = lambda item: None
        self.names_items = True
        self.most_items = 1000
        self.live: Callable[[WebSocket, dict[str, Any]], Any] | None = None
        self.sockets = 0
        self.first_label = datetime(2026, 1, 1, tzinfo=UTC)
        self.app = Starlette(
            routes=[
                WebSocketRoute("/v1/live", self._live),
                Route("/{path:path}", self._http, methods=["GET", "POST", "PUT", "PATCH", "DELETE"]),
            ]
        )

    def received(self, agent: str) -> list[dict[str, Any]]:
        return [self.records[key] for key in sorted(self.records) if key[0] == agent]

    async def _http(self, request: Request) -> Response:
        body = await request.body()
        path = request.url.path
        self.requests.append((request.method, f"{path}?{request.url.query}".rstrip("?"), dict(request.headers), body))
        if self.script:
            status, headers, content = self.script.popleft()
            return self._reply(status, headers, content)
        if path == "/v1/observations":
            return self._take(json.loads(body))
        if path.startswith("/v1/agents/"):
            return self._agent(path.rsplit("/", 1)[1])
        page = self.pages.get(f"{path}?{request.url.query}".rstrip("?"), self.pages.get(path))
        if page is None:
            return self._problem(404, f"there is no {path}")
        return self._reply(200, {}, page)

    def _take(self, batch: dict[str, Any]) -> Response:
        agent, items = batch["agent"], batch["observations"]
        if len(items) > self.most_items:
            return self._problem(413, "too large")
        bad, conflicts = [], []
        for index, item in enumerate(items):
            named = {"where": f"/observations/{index}", "index": index, "seq": item["seq"]}
            if reason := self.refuse(item):
                bad.append({**named, "why": reason})
            if self.records.get((agent, item["seq"]), item) != item:
                conflicts.append({**named, "why": "another body"})
        if bad or conflicts:
            return self._problem(422 if bad else 409, "bad items", (bad or conflicts) if self.names_items else [])
        fresh = [item for item in items if (agent, item["seq"]) not in self.records]
        self.records.update({(agent, item["seq"]): item for item in fresh})
        answer = {"accepted": len(fresh), "duplicates": len(items) - len(fresh), "head": len(self.records)}
        return self._reply(200, {}, {**answer, "a_field_of_a_newer_server": 1})

    def _agent(self, agent: str) -> Response:
        seqs = [seq for name, seq in self.records if name == agent]
        seen = self.first_label.isoformat() if seqs else None
        view = {
            "agent": agent,
            "room": "r",
            "next_seq": max(seqs, default=-1) + 1,
            "first_seen": seen,
            "last_seen": seen,
        }
        view |= {"last_observed_at": seen, "lag_s": 0.0, "missing": 0, "state": "connected"}
        return self._reply(200, {}, view)

    async def _live(self, websocket: WebSocket) -> None:
        self.sockets += 1
        await websocket.accept()
        assert self.live is not None
        with contextlib.suppress(WebSocketDisconnect):
            await self.live(websocket, await websocket.receive_json())

    def _problem(self, status: int, detail: str, items: list[Any] | None = None) -> Response:
        body = {"type": "about:blank", "title": "Problem", "status": status, "detail": detail, "items": items or []}
        return JSONResponse(body, status, media_type="application/problem+json")

    def _reply(self, status: int, headers: dict[str, str], content: Any) -> Response:
        if isinstance(content, str | bytes):
            return Response(content, status, headers)
        return Response(status_code=status) if content is None else JSONResponse(content, status, headers)


@pytest.fixture
def fake() -> Iterator[FakeTown]:
    fake = FakeTown()
    with serving(fake) as url:
        fake.url = url
        yield fake


@contextlib.contextmanager
def serving(fake: FakeTown) -> Iterator[str]:
    listener = socket.create_server(("127.0.0.1", 0))
    config = uvicorn.Config(fake.app, log_level="error", lifespan="off", ws="websockets-sansio")
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join(10)
        listener.close()
