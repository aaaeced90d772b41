"""A real server as a process of its own: ``tms serve`` on a free port."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import httpx


class ServerProcess:
    """Started by ``with``; ``url`` is where it listens. ``kill()`` is SIGKILL, ``stop()`` SIGTERM."""

    def __init__(self, data_dir: Path, database_url: str | None = None, *, port: int = 0, **env: str) -> None:
        self.data_dir = data_dir
        self._arguments = [
            sys.executable,
            "-m",
            "tms_client",
            "serve",
            "--data-dir",
            str(data_dir),
            "--port",
            str(port),
        ]
        if database_url:
            self._arguments += ["--database-url", database_url]
        self._env = os.environ | env
        self.url = ""

    def start(self, timeout_s: float = 90.0) -> ServerProcess:
        self.process = subprocess.Popen(self._arguments, stderr=subprocess.PIPE, text=True, env=self._env)
        assert self.process.stderr is not None
        lines = []
        for line in self.process.stderr:
            lines.append(line)
            if line.startswith("tms: http"):
                self.url = line.split()[1].rstrip("/")
                break
        else:
            raise RuntimeError("the server did not start:\n" + "".join(lines))
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            try:
                if httpx.get(self.url + "/readyz", timeout=5).status_code == 200:
                    return self
            except httpx.TransportError:
                time.sleep(0.05)
        raise RuntimeError("the server does not become ready")

    def kill(self) -> None:
        self.process.kill()
        self._reap()

    def stop(self) -> None:
        self.process.send_signal(signal.SIGTERM)
        self._reap()

    def _reap(self) -> None:
        self.process.wait(30)
        assert self.process.stderr is not None
        self.process.stderr.close()

    def __enter__(self) -> ServerProcess:
        return self.start()

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.stop()
        else:
            self._reap()
