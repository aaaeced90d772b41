"""Run the application under uvicorn, after checking what may be bound."""

from __future__ import annotations

import asyncio
import ipaddress
import socket
import sys

import uvicorn

from tms_client.cli import CommandError
from tms_server.app import create_app
from tms_server.auth import any_keys
from tms_server.db.lock import DatabaseOwned
from tms_server.garbage import tune_garbage_collector
from tms_server.settings import Settings


def serve(settings: Settings) -> int:
    """Serve until SIGINT or SIGTERM. Raises ``CommandError`` where it refuses to start."""
    if not is_loopback(settings.host) and not asyncio.run(any_keys(settings)):
        raise CommandError(
            f"refusing to listen on {settings.host} without API keys; make one: tms keys create NAME --scope admin"
        )
    listener = _bind(settings.host, settings.port)
    host, port = listener.getsockname()[:2]
    print(f"tms: http://{'[' + host + ']' if ':' in host else host}:{port}/", file=sys.stderr, flush=True)  # noqa: T201
    config = uvicorn.Config(
        create_app(settings),
        log_level="warning",
        access_log=False,
        ws="auto",
        timeout_graceful_shutdown=10,
        proxy_headers=False,
    )
    tune_garbage_collector()
    try:
        uvicorn.Server(config).run(sockets=[listener])
    except DatabaseOwned as error:
        raise CommandError(str(error)) from error
    return 0


def is_loopback(host: str) -> bool:
    """True for addresses that only this machine can reach; a name counts by all it resolves to."""
    try:
        found = {info[4][0] for info in socket.getaddrinfo(host, None)}
    except OSError:
        return False
    return bool(found) and all(ipaddress.ip_address(str(address).split("%")[0]).is_loopback for address in found)


def _bind(host: str, port: int) -> socket.socket:
    try:
        return socket.create_server(
            (host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET, backlog=2048
        )
    except OSError as error:
        raise CommandError(f"cannot listen on {host}:{port}: {error.strerror}") from error
