"""A running agent shows what it sees: a local socket beside its spool, a line of JSON per frame, only to who looks."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
from collections.abc import AsyncGenerator, Callable, Iterator
from pathlib import Path
from typing import Any

log = logging.getLogger(__name__)
_PERIOD_S = 0.2
_MAX_VIEWERS = 8
_MAX_LINE = 1 << 22


def socket_path(spool: Path) -> Path:
    return spool.with_name(spool.name + ".watch")


async def serve_view(path: Path, view: Callable[[], dict[str, Any]]) -> None:
    """Serve until cancelled. The caller owns the spool, so a socket that is there already is a dead one.

    Where there can be no socket (FAT, shares of other computers), that is said, and the agent works without.
    """
    viewers: set[asyncio.Task[None]] = set()

    async def show(writer: asyncio.StreamWriter) -> None:
        try:
            with contextlib.suppress(ConnectionError):
                while True:
                    writer.write(json.dumps(view()).encode() + b"\n")
                    await writer.drain()
                    await asyncio.sleep(_PERIOD_S)
        finally:
            writer.close()

    def come(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(viewers) == _MAX_VIEWERS:
            writer.close()
            return
        viewers.add(task := asyncio.create_task(show(writer)))
        task.add_done_callback(viewers.discard)

    try:
        _remove(path)
        with _short(path) as name:
            server = await asyncio.start_unix_server(come, name)
        os.chmod(path, 0o600)  # noqa: PTH101 - one quick call
    except OSError as error:
        log.warning("%s: %s; nobody can watch this agent", path, error.strerror or error)
        return
    try:
        await asyncio.Event().wait()
    finally:
        server.close()
        _remove(path)
        for task in viewers:
            task.cancel()
        await asyncio.gather(*viewers, return_exceptions=True)


async def views(path: Path) -> AsyncGenerator[dict[str, Any], None]:
    """What a running agent shows, until it ends.

    Raises:
        OSError: no agent runs here.
    """
    with _short(path) as name:
        reader, writer = await asyncio.open_unix_connection(name, limit=_MAX_LINE)
    try:
        with contextlib.suppress(ConnectionError):
            while line := await reader.readline():
                yield json.loads(line)
    finally:
        writer.close()


async def shows(path: Path) -> bool:
    """Whether an agent runs here and shows what it sees: one that was killed leaves its socket behind."""
    with contextlib.suppress(OSError):
        async with contextlib.aclosing(views(path)) as shown:
            async for _ in shown:
                return True
    return False


def _remove(path: Path) -> None:
    path.unlink(missing_ok=True)


@contextlib.contextmanager
def _short(path: Path) -> Iterator[str]:
    """A name for the socket that is short enough (108 bytes), however deep the folder lies."""
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{folder}/{path.name}"
    finally:
        os.close(folder)
