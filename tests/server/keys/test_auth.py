"""Keys on a running server: who gets in, who does not, and how soon a revocation is felt."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI, WebSocket

from tms_client import cli
from tms_server.auth import RoomReader, any_keys
from tms_server.settings import Settings

MakeKey = Callable[..., Awaitable[str]]


def bearer(key: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {key}"}


async def test_without_keys_loopback_is_the_administrator(http: httpx.AsyncClient) -> None:
    assert (await http.get("/v1/me")).json() == {"key": None, "name": "loopback", "scopes": ["admin"]}


async def test_loopback_addresses(http: httpx.AsyncClient) -> None:
    for host in ("127.0.0.1", "127.8.7.6:8080", "localhost:8080", "[::1]:8080"):
        assert (await http.get("/v1/me", headers={"Host": host})).status_code == 200


REFUSED = [
    {"Host": "town.example"},  # DNS rebinding
    {"Host": "192.168.1.4:8080"},
    {"Host": "[::1"},
    {"Host": ""},
    {"Forwarded": "for=10.0.0.1"},
    {"X-Forwarded-For": "127.0.0.1"},
    {"X-Forwarded-Proto": "https"},
    {"Origin": "https://evil.example"},
    {"Origin": "null"},
    {"Authorization": "Bearer tms_00000000_" + 64 * "0"},
    {"Authorization": "Basic YTpi"},
]


async def test_without_keys_everything_else_is_refused(http: httpx.AsyncClient) -> None:
    for headers in REFUSED:
        answer = await http.get("/v1/me", headers=headers)
        assert answer.status_code == 401, headers
        assert answer.headers["WWW-Authenticate"] == "Bearer"
        assert answer.json()["title"] == "Not authenticated"


@pytest.mark.parametrize(
    ("peer", "server"), [("10.0.0.7", "127.0.0.1"), ("127.0.0.1", "10.0.0.1"), ("::ffff:10.0.0.7", "127.0.0.1")]
)
async def test_without_keys_peer_and_address_must_be_loopback(app: FastAPI, peer: str, server: str) -> None:
    transport = httpx.ASGITransport(app=app.with_state, client=(peer, 4000))  # type: ignore[attr-defined]
    async with httpx.AsyncClient(transport=transport, base_url=f"http://{server}") as remote:
        assert (await remote.get("/v1/me", headers={"Host": "127.0.0.1"})).status_code == 401
        assert (await remote.get("/healthz")).status_code == 200


async def test_with_keys_loopback_needs_one_too(http: httpx.AsyncClient, make_key: MakeKey) -> None:
    key = await make_key("observe:lab", "read:*")
    assert (await http.get("/v1/me")).status_code == 401
    assert (await http.get("/v1/me", headers=bearer(key[:-1] + ("0" if key[-1] != "0" else "1")))).status_code == 401
    answer = await http.get("/v1/me", headers=bearer(key) | {"X-Forwarded-For": "10.0.0.1", "Host": "town.example"})
    assert answer.json() == {"key": key.split("_")[1], "name": "test", "scopes": ["observe:lab", "read:*"]}


async def test_revocation_is_felt_within_five_seconds_and_opens_nothing(
    http: httpx.AsyncClient, make_key: MakeKey, database_url: str
) -> None:
    key = await make_key("admin")
    assert (await http.get("/v1/me", headers=bearer(key))).status_code == 200
    revoke = ["keys", "revoke", key.split("_")[1], "--database-url", database_url]
    assert await asyncio.to_thread(cli.main, revoke) == 0
    await asyncio.sleep(1.5)
    assert (await http.get("/v1/me", headers=bearer(key))).status_code == 401
    assert (await http.get("/v1/me")).status_code == 401


async def test_the_page_logs_in_and_out(http: httpx.AsyncClient, make_key: MakeKey) -> None:
    key = await make_key("read:lab")
    assert (await http.post("/v1/login", json={"key": "nonsense"})).status_code == 401
    answer = await http.post("/v1/login", json={"key": key}, headers={"Origin": "http://127.0.0.1"})
    assert answer.status_code == 200
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert (await http.get("/v1/me")).json()["scopes"] == ["read:lab"]
    assert (await http.get("/v1/me", headers={"Origin": "http://evil.example"})).status_code == 401
    assert (await http.post("/v1/logout")).status_code == 204
    assert (await http.get("/v1/me")).status_code == 401


async def test_a_websocket_is_checked_like_a_request(app: FastAPI, make_key: MakeKey) -> None:
    @app.websocket("/ws/{room}")
    async def greet(websocket: WebSocket, room: str, caller: RoomReader) -> None:
        await websocket.accept()
        await websocket.close()

    assert await handshake(app, "/ws/lab") == "websocket.accept"
    assert await handshake(app, "/ws/lab", origin="http://evil.example") == 401
    key = await make_key("read:lab")
    assert await handshake(app, "/ws/lab") == 401
    assert await handshake(app, "/ws/lab", authorization=f"Bearer {key}") == "websocket.accept"
    assert await handshake(app, "/ws/lab", cookie=f"tms_key={key}", origin="http://127.0.0.1") == "websocket.accept"
    assert await handshake(app, "/ws/kitchen", authorization=f"Bearer {key}") == 403


async def handshake(app: FastAPI, path: str, **headers: str) -> Any:
    """What the server says first: the message type of an accept, or the status of a refusal."""
    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": "websocket.connect"}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    scope = {
        "type": "websocket",
        "asgi": {"version": "3.0"},
        "scheme": "ws",
        "path": path,
        "raw_path": path.encode(),
        "query_string": b"",
        "headers": [(b"host", b"127.0.0.1"), *((k.encode(), v.encode()) for k, v in headers.items())],
        "client": ("127.0.0.1", 4000),
        "server": ("127.0.0.1", 80),
        "subprotocols": [],
        "extensions": {"websocket.http.response": {}},
    }
    await app.with_state(scope, receive, send)  # type: ignore[attr-defined]
    return sent[0].get("status", sent[0]["type"])


def test_the_command_makes_lists_and_revokes(
    database_url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where = ["--database-url", database_url, "--data-dir", str(tmp_path)]
    settings = Settings(database_url=database_url, data_dir=tmp_path)
    assert not asyncio.run(any_keys(settings))
    assert cli.main(["keys", "create", "robot 1", "--scope", "read:lab", "--scope", "observe:*", *where]) == 0
    key = capsys.readouterr().out.strip()
    _, key_id, secret = key.split("_")
    assert asyncio.run(any_keys(settings))
    assert cli.main(["keys", "list", *where]) == 0
    listed = capsys.readouterr().out
    assert key_id in listed
    assert "observe:* read:lab" in listed
    assert secret not in listed
    assert cli.main(["keys", "revoke", key_id, *where]) == 0
    assert not asyncio.run(any_keys(settings))


@pytest.mark.parametrize(
    "arguments",
    [["create", "x", "--scope", "write:lab"], ["create", "x"], ["create", " ", "--scope", "admin"], ["revoke", "nope"]],
)
def test_bad_input_is_one_line_and_status_2(
    arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["keys", *arguments, "--data-dir", str(tmp_path)]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_the_secret_is_not_in_the_database(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["keys", "create", "x", "--scope", "admin", "--data-dir", str(tmp_path)]) == 0
    secret = capsys.readouterr().out.strip().split("_")[2]
    stored = b"".join(path.read_bytes() for path in tmp_path.rglob("*") if path.is_file())
    assert secret.encode() not in stored
    assert bytes.fromhex(secret) not in stored
