"""The server as a process of its own, found by the address it prints."""

from __future__ import annotations

import contextlib
import os
import queue
import re
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import httpx

from tms_client.cli import CommandError

_ADDRESS = re.compile(r"(http://\S+)")
START_S = 120.0
#: So long (s) a process may take to end in order: on a slow computer it may be compiling a kernel.
_ORDER_S = 60.0
USUAL_PORT = 8080


@contextmanager
def server(data_dir: Path, port: int | None, say: Callable[[str], None]) -> Iterator[str]:
    """Run ``tms serve`` on loopback; its URL. Stopped at the end, by force where it does not listen.

    Without a ``port`` it is the usual one, or a free one where that is taken.

    Raises:
        CommandError: it did not come up; the message has its last words.
    """
    if port is None:
        port = USUAL_PORT if _is_free(USUAL_PORT) else 0
    environment = dict(os.environ)
    # The data may be thrown away after the demo, the compiled code is worth keeping.
    environment.setdefault("NUMBA_CACHE_DIR", str(_cache()))
    if not any(Path(environment["NUMBA_CACHE_DIR"]).rglob("*.nbc")):
        say("compiling the belief engine, which happens at the first start only (up to 20 s) ...")
    process = subprocess.Popen(
        [sys.executable, "-m", "tms_client", "serve", "--port", str(port), "--data-dir", str(data_dir)],
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        text=True,
        env=environment,
        # Ctrl-C is ours to handle: the agents stop first, then the server.
        start_new_session=True,
    )
    try:
        assert process.stderr is not None
        yield _ready(process, _follow(process.stderr))
    finally:
        stop(process)


def _ready(process: subprocess.Popen[str], lines: queue.Queue[str | None]) -> str:
    deadline, last, url = time.monotonic() + START_S, "", None
    while time.monotonic() < deadline:
        try:
            line = lines.get(timeout=0.1)
        except queue.Empty:
            line = ""
        if line is None:
            raise CommandError(f"the server did not start: {last or f'exit status {process.wait()}'}")
        last = line.strip() or last
        if url is None and (found := _ADDRESS.search(line)):
            url = found[1].rstrip("/")
        if url is not None and _answers(url):
            return url
    raise CommandError(f"the server did not come up within {START_S:.0f} s: {last}")


def _is_free(port: int) -> bool:
    try:
        socket.create_server(("127.0.0.1", port)).close()
    except OSError:
        return False
    return True


def _answers(url: str) -> bool:
    try:
        return httpx.get(f"{url}/readyz", timeout=2.0).is_success
    except httpx.HTTPError:
        return False


def _follow(stream: IO[str]) -> queue.Queue[str | None]:
    """Read the server's stderr to its end, so that it never waits for us; lines also go to our own."""
    lines: queue.Queue[str | None] = queue.Queue()

    def run() -> None:
        with stream:
            for line in stream:
                lines.put(line)
                if not _ADDRESS.search(line):
                    sys.stderr.write(line)
        lines.put(None)

    threading.Thread(target=run, name="stderr of the server", daemon=True).start()
    return lines


def stop(*processes: subprocess.Popen[Any]) -> None:
    """End processes in order, all at once, by force where one does not listen.

    Each is told once: told again, an agent hurries, and what it says at its end may not get to the server.
    """
    running = [process for process in processes if process.poll() is None]
    for process in running:
        process.terminate()
    try:
        for process in running:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_ORDER_S)
    finally:  # one hangs, or Ctrl-C came again: none is left behind
        for process in running:
            if process.poll() is None:
                process.kill()
                process.wait()


def _cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tms" / "compiled"
