"""``tms floor watch``: the floor in the terminal or as a picture."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import io
import math
import os
import shutil
import sys
import time
from collections.abc import AsyncGenerator, Iterator
from pathlib import Path
from typing import Any

from tms_agents.commands.floor_files import require_place
from tms_agents.commands.floor_replay import recordings_of
from tms_agents.config import read_config
from tms_agents.files import write_atomically
from tms_agents.floor.calibration.poses import calibrated
from tms_agents.floor.config import FloorConfig
from tms_agents.floor.watch import watching
from tms_agents.floor.watch.picture import frame_of, png
from tms_agents.floor.watch.screen import screen
from tms_agents.live import shows, socket_path
from tms_agents.running import until_signalled
from tms_client.cli import CommandError

_PNG_S = 1.0
#: When, and what is shown.
_View = tuple[float, dict[str, Any]]


def watch(arguments: argparse.Namespace) -> int:
    for option in ("speed", "wait"):
        if not 0 <= getattr(arguments, option) < math.inf:
            raise CommandError(f"--{option} is 0 or more")
    require_place(arguments.png, ".png")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal that has no braille still shows the list
    if arguments.scans:
        return _watch_recordings(arguments)
    if arguments.config is None:
        raise CommandError("what shall be watched? --config of an agent, or recordings")
    config, poses = calibrated(read_config(arguments.config, FloorConfig), arguments.config)
    if arguments.once:
        asyncio.run(_once(arguments, config, poses))
        return 0
    with contextlib.suppress(asyncio.CancelledError):
        asyncio.run(until_signalled(_show(watching.watch(config, poses), arguments.png)))
    return 0


def _watch_recordings(arguments: argparse.Namespace) -> int:
    config, recordings = recordings_of(arguments)
    every_s = 0.1 * max(1.0, arguments.speed) if arguments.speed else 1.0
    played = _played(arguments, watching.play(recordings, config, every_s))
    if arguments.once or (arguments.png is not None and arguments.speed == 0):
        view: dict[str, Any] = {}
        start: float | None = None
        for t, view in played:  # noqa: B007 - the last one
            start = t if start is None else start
            if arguments.once and t - start >= arguments.wait:
                break
        _put(view, arguments.png)
        return 0
    with contextlib.suppress(asyncio.CancelledError):
        asyncio.run(until_signalled(_show(_paced(played, arguments.speed), arguments.png)))
    return 0


def _played(arguments: argparse.Namespace, views: Iterator[_View]) -> Iterator[_View]:
    """The same; recordings that no estimator can use are said to be so."""
    try:
        yield from views
    except ValueError as error:
        raise CommandError(f"{', '.join(map(str, arguments.scans))}: {error}") from error


async def _paced(played: Iterator[_View], speed: float) -> AsyncGenerator[dict[str, Any], None]:
    begun, first = time.monotonic(), None
    for t, view in played:
        first = t if first is None else first
        await asyncio.sleep(max(0.0, begun + (t - first) / speed - time.monotonic()) if speed else 0.0)
        yield view


async def _once(arguments: argparse.Namespace, config: FloorConfig, poses: Any) -> None:
    """The agent's next view; the lasers' own after they had time to say something."""
    loop = asyncio.get_running_loop()
    runs = await shows(socket_path(config.spool.path))
    until = loop.time() + (1.0 if runs else arguments.wait)
    shown = watching.watch(config, poses) if runs else watching.watch_lasers(config, poses)
    async with contextlib.aclosing(shown) as found:
        async for view in found:
            if loop.time() >= until:
                _put(view, arguments.png)
                return


def _put(view: dict[str, Any], file: Path | None) -> None:
    if file is not None:
        _picture(view, file, None)
        return
    size = shutil.get_terminal_size()
    sys.stdout.write("\n".join(screen(view, columns=size.columns, rows=size.lines)) + "\n")


def _picture(view: dict[str, Any], file: Path, frame: tuple[float, float, float, float] | None) -> None:
    try:
        write_atomically(file, png(view, frame=frame))
    except OSError as error:
        raise CommandError(f"{file}: {error.strerror}") from error


async def _show(views: AsyncGenerator[dict[str, Any], None], file: Path | None) -> None:
    """Until it is cancelled or there are no more; a picture file is written anew every second."""
    terminal = sys.stdout.isatty() and file is None
    frame: tuple[float, float, float, float] | None = None
    written = -_PNG_S
    if terminal:
        sys.stdout.write("\x1b[?1049h\x1b[?25l")  # the other screen, without cursor
    try:
        async with contextlib.aclosing(views) as shown:
            async for view in shown:
                frame = _wider(frame, frame_of([view]))
                if file is not None:
                    if time.monotonic() - written >= _PNG_S:
                        written = time.monotonic()
                        _picture(view, file, frame)
                    continue
                size = shutil.get_terminal_size()
                colour = terminal and not os.environ.get("NO_COLOR")
                lines = screen(view, columns=size.columns, rows=size.lines - 1, colour=colour, frame=frame)
                home, clear = ("\x1b[H", "\x1b[K\n") if terminal else ("", "\n")
                sys.stdout.write(home + "".join(line + clear for line in lines) + ("\x1b[J" if terminal else "\n"))
                sys.stdout.flush()
    finally:
        if terminal:
            sys.stdout.write("\x1b[?25h\x1b[?1049l")


def _wider(
    before: tuple[float, float, float, float] | None, now: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    """So that the picture does not jump about."""
    if before is None:
        return now
    return (min(before[0], now[0]), min(before[1], now[1]), max(before[2], now[2]), max(before[3], now[3]))
