"""Devices are served while the event loop waits, and everything else goes on: timers, tasks, sockets, signals."""

from __future__ import annotations

import asyncio
import itertools
import os
import signal
import socket
import time

import pytest

from tms_agents.devices import waiting
from tms_agents.devices.waiting import DeviceLoop, watch


@pytest.fixture(params=["ours", "any"])
def run(request):
    """Run a coroutine in our event loop, and in any other one."""
    return waiting.run if request.param == "ours" else asyncio.run


@pytest.fixture
def line():
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    with ours, theirs:
        yield ours, theirs


def test_ours_is_what_runs():
    async def main():
        return asyncio.get_running_loop()

    assert isinstance(waiting.run(main()), DeviceLoop)


def test_what_comes_is_read_without_a_task_and_tasks_go_on_when_they_are_to(run, line):
    ours, theirs = line

    async def main():
        done = asyncio.get_running_loop().create_future()
        got = []

        def turn(readable):
            got.append(ours.recv(1))
            if len(got) < 50:
                theirs.send(b"x")
                return False
            done.set_result(None)
            return True

        one = watch(ours.fileno(), turn)
        theirs.send(b"x")
        async with asyncio.timeout(5):
            await done
        one.close()
        theirs.send(b"y")
        await asyncio.sleep(0.02)
        return got

    assert run(main()) == [b"x"] * 50


def test_a_device_is_served_when_it_is_due_again_and_again(run):
    async def main():
        loop = asyncio.get_running_loop()
        done, at = loop.create_future(), []

        def turn(readable):
            at.append(loop.time())
            one.due = loop.time() + 0.01
            if len(at) == 5:
                done.set_result(None)
            return len(at) == 5

        one = watch(None, turn)
        one.due = began = loop.time() + 0.01
        async with asyncio.timeout(5):
            await done
        one.close()
        await asyncio.sleep(0.03)
        return began, at

    began, at = run(main())
    assert len(at) == 5 and at[0] >= began - 0.001
    assert all(later - earlier >= 0.009 for earlier, later in itertools.pairwise(at))


def test_a_device_that_never_stops_talking_holds_up_nobody(run, line):
    ours, theirs = line

    async def main():
        one = watch(ours.fileno(), lambda readable: False)  # it is never read: there is always something
        theirs.send(b"x")
        began = time.monotonic()
        for _ in range(10):
            await asyncio.sleep(0.005)
        assert await asyncio.to_thread(lambda: 7) == 7
        one.close()
        return time.monotonic() - began

    assert run(main()) < 5


def test_one_device_closes_another_one_in_its_turn(run, line):
    ours, theirs = line

    async def main():
        turns = []
        first = watch(None, lambda readable: turns.append("first") or second.close() or first.close() or False)
        second = watch(ours.fileno(), lambda readable: turns.append("second") or False)
        first.due = asyncio.get_running_loop().time()
        second.due = first.due + 0.05
        await asyncio.sleep(0.1)
        theirs.send(b"x")
        await asyncio.sleep(0.02)
        return turns

    assert run(main()) == ["first"]


def test_signals_and_sockets_of_asyncio_come_through_beside_devices(run, line):
    async def main():
        loop = asyncio.get_running_loop()
        told = asyncio.Event()
        loop.add_signal_handler(signal.SIGUSR1, told.set)
        one = watch(line[0].fileno(), lambda readable: False)
        server = await asyncio.start_server(lambda reader, writer: writer.close(), "127.0.0.1", 0)
        reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
        os.kill(os.getpid(), signal.SIGUSR1)
        async with asyncio.timeout(5):
            await told.wait()
            assert await reader.read() == b""
        writer.close()
        server.close()
        one.close()
        loop.remove_signal_handler(signal.SIGUSR1)

    run(main())


def test_a_watched_file_that_was_closed_is_watched_anew_under_its_number(run, line):
    async def main():
        ours, theirs = line
        heard = []
        for text in (b"a", b"b"):
            copy = os.dup(ours.fileno())
            one = watch(copy, lambda readable, copy=copy: heard.append(os.read(copy, 10)) or False)
            theirs.send(text)
            await asyncio.sleep(0.02)
            one.close()
            os.close(copy)
        return heard

    assert run(main()) == [b"a", b"b"]
