"""``tms cabinet``: calibrate the boards of a smart cabinet, and watch what they see."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path

from tms_agents.cabinet.calibrating import Spot, measure_and_solve, parse_spots, usual_spots
from tms_agents.cabinet.calibration_file import BoardCalibration, read_calibration, write_calibration
from tms_agents.cabinet.config import BoardSection, CabinetConfig
from tms_agents.cabinet.measuring import Measuring
from tms_agents.cabinet.runner import require_calibration
from tms_agents.cabinet.screen import screen
from tms_agents.cabinet.sources import open_loads
from tms_agents.cabinet.watching import watch, watch_devices
from tms_agents.config import read_config
from tms_agents.live import shows, socket_path
from tms_agents.running import until_signalled
from tms_client.cli import ArgumentParser, CommandError


def main(argv: Sequence[str]) -> int:
    parser = ArgumentParser(prog="tms cabinet", description="Calibrate and watch a smart cabinet.")
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="COMMAND")
    calibrate = kinds.add_parser("calibrate", help="find gain and offset of every cell with a known weight")
    calibrate.set_defaults(work=_calibrate)
    calibrate.add_argument("--board", metavar="NAME", help="which board, where the cabinet has several")
    calibrate.add_argument("--weight", type=float, metavar="G", help="grams of the weight, for the usual five spots")
    calibrate.add_argument(
        "--weights", metavar="SPOTS", help="grams and places of your own: '500@0.10,0.10;500@0.30,0.10;...' (metres)"
    )
    calibrate.add_argument("--auto", action="store_true", help="no keys: go on when the load has changed and rests")
    calibrate.add_argument("--positions", action="store_true", help="find the positions of the cells, too")
    calibrate.add_argument("--force", action="store_true", help="keep a calibration with large residuals")
    calibrate.add_argument("--seconds", type=float, default=1.0, metavar="S", help="measure so long (default 1)")
    calibrate.add_argument("--timeout", type=float, default=120.0, metavar="S", help="wait so long for each load")
    show = kinds.add_parser("watch", help="see live what the boards and readers see")
    show.set_defaults(work=_watch)
    show.add_argument("--once", action="store_true", help="print one picture and leave")
    show.add_argument("--wait", type=float, default=2.0, metavar="S", help="with --once: look so long before")
    for command in (calibrate, show):
        command.add_argument("--config", type=Path, required=True, metavar="FILE", help="TOML file of the agent")
    arguments = parser.parse_args(argv)
    config = read_config(arguments.config, CabinetConfig)
    done: int = arguments.work(arguments, config)
    return done


def _calibrate(arguments: argparse.Namespace, config: CabinetConfig) -> int:
    board = _board(config, arguments.board)
    if not (0.2 <= arguments.seconds <= 60 and arguments.timeout > arguments.seconds):
        raise CommandError("--seconds is 0.2 to 60, and --timeout longer")
    if arguments.weights:
        spots = parse_spots(arguments.weights, board)
    elif arguments.weight and arguments.weight > 0:
        spots = usual_spots(arguments.weight, board)
    else:
        raise CommandError("which weight? --weight 500 for the usual spots, or --weights for your own")
    path = config.calibration_path(arguments.config)
    known = read_calibration(path)  # before the work, not after it
    found = asyncio.run(until_signalled(_measure(arguments, config, board, spots)))
    old = write_calibration(path, known | {board.name: found})
    sys.stdout.write(f"Written to {path}{f'; the old one is {old.name}' if old else ''}.\n")
    return 0


async def _measure(
    arguments: argparse.Namespace,
    config: CabinetConfig,
    board: BoardSection,
    spots: Sequence[Spot],
    clock: Callable[[], float] = time.time,
) -> BoardCalibration:
    if await shows(socket_path(config.spool.path)):
        raise CommandError(f"agent {config.agent} is running and has the devices: stop it first")
    source = open_loads(board.load, config.silent_after_s)
    keys = _Keys()

    async def prompt(text: str) -> None:
        _say(f"{text}{'.' if arguments.auto else ', then press Enter.'}")
        if not arguments.auto:
            await keys.line()

    async with Measuring(
        source, board.cell_count, window_s=arguments.seconds, timeout_s=arguments.timeout
    ) as measuring:
        solution = await measure_and_solve(
            board,
            measuring,
            spots,
            prompt,
            _say,
            with_positions=arguments.positions,
            wait_for_change=arguments.auto,
            force=arguments.force,
        )
    return BoardCalibration.of(solution, datetime.fromtimestamp(clock(), UTC), with_cells=arguments.positions)


def _board(config: CabinetConfig, name: str | None) -> BoardSection:
    names = [one.name for one in config.boards]
    if name is None and len(names) == 1:
        return config.boards[0]
    if name not in names:
        raise CommandError(f"--board must be one of: {', '.join(names)}")
    return config.boards[names.index(name)]


def _watch(arguments: argparse.Namespace, config: CabinetConfig) -> int:
    calibrations = read_calibration(config.calibration_path(arguments.config))
    require_calibration(config, calibrations)
    if arguments.once:
        asyncio.run(_show_once(arguments, config, calibrations))
    else:
        with contextlib.suppress(asyncio.CancelledError):
            asyncio.run(until_signalled(_show(config, calibrations)))
    return 0


async def _show_once(
    arguments: argparse.Namespace, config: CabinetConfig, calibrations: dict[str, BoardCalibration]
) -> None:
    """The agent's next view; the devices' own after they had time to say something."""
    loop = asyncio.get_running_loop()
    runs = await shows(socket_path(config.spool.path))
    until = loop.time() + (0.0 if runs else arguments.wait)
    views = watch(config, calibrations) if runs else watch_devices(config, calibrations)
    async with contextlib.aclosing(views) as shown:
        async for view in shown:
            if loop.time() >= until:
                size = shutil.get_terminal_size()
                sys.stdout.write("\n".join(screen(view, columns=size.columns, rows=size.lines)) + "\n")
                return


async def _show(config: CabinetConfig, calibrations: dict[str, BoardCalibration]) -> None:
    terminal = sys.stdout.isatty()
    if terminal:
        sys.stdout.write("\x1b[?1049h\x1b[?25l")  # the other screen, without cursor
    try:
        async with contextlib.aclosing(watch(config, calibrations)) as shown:
            async for view in shown:
                size = shutil.get_terminal_size()
                colour = terminal and not os.environ.get("NO_COLOR")
                lines = screen(view, columns=size.columns, rows=size.lines - 1, colour=colour)
                home, clear = ("\x1b[H", "\x1b[K\n") if terminal else ("", "\n")
                sys.stdout.write(home + "".join(line + clear for line in lines) + ("\x1b[J" if terminal else "\n"))
                sys.stdout.flush()
    finally:
        if terminal:
            sys.stdout.write("\x1b[?25h\x1b[?1049l")


class _Keys:
    """Lines of stdin, waited for without a thread that would outlive Ctrl-C."""

    def __init__(self) -> None:
        self._rest = b""

    async def line(self) -> None:
        """The next line.

        Raises:
            CommandError: there is none.
        """
        loop = asyncio.get_running_loop()
        while b"\n" not in self._rest:
            ready = asyncio.Event()
            loop.add_reader(sys.stdin.fileno(), ready.set)
            try:
                await ready.wait()
            finally:
                loop.remove_reader(sys.stdin.fileno())
            data = os.read(sys.stdin.fileno(), 4096)
            if not data:
                raise CommandError("nobody presses Enter: use --auto where there are no keys")
            self._rest += data
        self._rest = self._rest.partition(b"\n")[2]


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()
