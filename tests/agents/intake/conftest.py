"""A real server with a catalogue, and ``tms intake`` as a carer meets it: in a terminal of its own."""

from __future__ import annotations

import asyncio
import os
import pty
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from server_process import ServerProcess

from tms_client import Town, cli
from tms_schemas.objects import ObjectFields, ProductIn
from tms_schemas.rooms import RoomIn

TEA, CUP = "4901777018686", "4569951116117"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    with ServerProcess(tmp_path_factory.mktemp("server")) as server, Town(server.url) as town:
        town.rooms.put("lab", RoomIn.model_validate({"name": "Lab", "outline": [[0, 0], [5, 0], [5, 4]]}))
        town.products.put(TEA, ProductIn(name="お茶 500ml", weight_g=525, size_m=(0.07, 0.07, 0.2)))
        town.products.put(CUP, ProductIn(name="cup"))
        town.objects.put("E004000000000001", ObjectFields(name="scissors", room="lab"))
        yield server


class Carer:
    """Sits before ``tms intake``: types, and reads what it says."""

    def __init__(self, *arguments: str, **env: str) -> None:
        self._master, slave = pty.openpty()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tms_client", "intake", *arguments],
            env=os.environ | env,
            preexec_fn=lambda: os.login_tty(slave),
            pass_fds=[slave],
        )
        os.close(slave)
        self.screen = ""
        self._raw = b""
        asyncio.get_running_loop().add_reader(self._master, self._look)

    def type(self, text: str) -> None:
        os.write(self._master, f"{text}\n".encode())

    async def sees(self, pattern: str, timeout_s: float = 20.0) -> str:
        """Wait for a line that fits; what is before it and the line itself are forgotten."""
        async with asyncio.timeout(timeout_s):
            while not (found := re.search(rf".*{pattern}.*\n", self.screen)):
                if self._process.poll() is not None:
                    raise AssertionError(f"it ended without {pattern!r}:\n{self.screen}")
                await asyncio.sleep(0.02)
        self.screen = self.screen[found.end() :]
        return found[0].strip()

    async def presses_ctrl_c(self) -> tuple[int, str]:
        """Exit status, and the last line."""
        os.write(self._master, b"\x03")
        return await self.leaves()

    async def leaves(self) -> tuple[int, str]:
        status = await asyncio.to_thread(self._process.wait, 20)
        await asyncio.sleep(0.05)
        return status, self.screen.strip().splitlines()[-1]

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self._master)
        os.close(self._master)
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()

    def _look(self) -> None:
        try:
            self._raw += os.read(self._master, 4096)
        except OSError:  # the other end is closed
            asyncio.get_running_loop().remove_reader(self._master)
        whole, newline, self._raw = self._raw.rpartition(b"\n")
        self.screen += (whole + newline).decode().replace("\r\n", "\n")


@pytest.fixture
async def carer(server: ServerProcess):
    """Start ``tms intake`` with these arguments."""
    started: list[Carer] = []

    def start(*arguments: str, url: str = server.url, **env: str) -> Carer:
        started.append(Carer(*arguments, TMS_URL=url, **env))
        return started[-1]

    yield start
    for one in started:
        one.close()


class Done(NamedTuple):
    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def intake(
    server: ServerProcess, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Done]:
    """``tms intake`` in this process: one call with everything in it."""

    def run(*arguments: str, url: str = server.url) -> Done:
        monkeypatch.setenv("TMS_URL", url)
        return Done(cli.main(["intake", *arguments]), *capsys.readouterr())

    return run


@pytest.fixture
def piped(server: ServerProcess) -> Callable[..., subprocess.CompletedProcess[str]]:
    """``tms intake`` behind a pipe."""

    def run(*arguments: str, typed: str = "", url: str = server.url, **env: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "tms_client", "intake", *arguments]
        return subprocess.run(
            command, input=typed, capture_output=True, text=True, timeout=60, env=os.environ | {"TMS_URL": url} | env
        )

    return run


@pytest.fixture
def configure(tmp_path: Path) -> Callable[[str], str]:
    def write(text: str) -> str:
        path = tmp_path / "intake.toml"
        path.write_text(text)
        return str(path)

    return write
