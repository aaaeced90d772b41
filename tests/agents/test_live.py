"""What a running agent shows, over its local socket: also where one was killed and left the socket behind."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from pathlib import Path

import pytest

from tms_agents.cabinet import watching as cabinet
from tms_agents.floor.watch import watching as floor
from tms_agents.live import serve_view, shows, socket_path, views


@contextlib.asynccontextmanager
async def served(path: Path):
    task = asyncio.create_task(serve_view(path, lambda: {"source": "agent"}))
    while not await shows(path):
        await asyncio.sleep(0.01)
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def killed(path: Path) -> None:
    """The socket of an agent that had no time to remove it."""
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(str(path))


async def test_where_there_can_be_no_socket_the_agent_works_without(tmp_path, caplog):
    path = tmp_path / "spool.watch"
    path.mkdir()
    await asyncio.wait_for(serve_view(path, dict), 10.0)
    assert caplog.messages == [f"{path}: Is a directory; nobody can watch this agent"]


async def test_it_shows_while_it_runs(tmp_path):
    path = tmp_path / "spool.watch"
    assert not await shows(path)
    async with served(path):
        assert await shows(path)
        async with contextlib.aclosing(views(path)) as shown:
            assert await anext(shown) == {"source": "agent"}
    assert not path.exists() and not await shows(path)


async def test_a_killed_one_shows_nothing_and_the_next_takes_its_place(tmp_path):
    path = tmp_path / "spool.watch"
    killed(path)
    assert path.exists() and not await shows(path)
    async with served(path):
        assert await shows(path)


async def test_whoever_comes_when_there_are_too_many_gets_nothing_and_disturbs_nobody(tmp_path):
    path = tmp_path / "spool.watch"
    async with served(path), contextlib.AsyncExitStack() as stack:
        await asyncio.sleep(0.6)  # until it is noticed that who looked has gone
        shown = [await stack.enter_async_context(contextlib.aclosing(views(path))) for _ in range(8)]
        for one in shown:
            await anext(one)
        assert not await shows(path)
        for one in shown:
            assert await anext(one) == {"source": "agent"}


@pytest.mark.parametrize(("watching", "devices"), [(floor, "watch_lasers"), (cabinet, "watch_devices")])
async def test_devices_are_watched_until_an_agent_runs(tmp_path, monkeypatch, watching, devices):
    """They are opened once, not for every view, where only a dead socket lies; an agent gets them when it starts."""
    opened = []

    async def look(*_):
        opened.append(len(opened))
        while True:
            yield {"source": "devices"}
            await asyncio.sleep(0.01)

    monkeypatch.setattr(watching, devices, look)
    config = type("Config", (), {"spool": type("Spool", (), {"path": tmp_path / "spool"})})
    path = socket_path(tmp_path / "spool")
    killed(path)
    async with contextlib.aclosing(watching.watch(config, {})) as shown:
        assert [(await anext(shown))["source"] for _ in range(5)] == ["devices"] * 5
        assert opened == [0]
        async with served(path):
            while (await anext(shown))["source"] != "agent":
                pass
        assert opened == [0]
        while (await anext(shown))["source"] != "devices":
            pass
        assert opened == [0, 1]
