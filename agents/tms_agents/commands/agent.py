"""``tms agent``: one agent on a sensor host."""

from __future__ import annotations

import asyncio
import logging
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from tms_agents.config import read_config
from tms_agents.hand.config import CaptureSource, HandConfig
from tms_agents.hand.runner import Tally, run
from tms_client.cli import ArgumentParser, CommandError
from tms_client.errors import SpoolError

_STOP_S = 2.0  # for what still waits when the agent is asked to stop; the rest stays in the spool


def main(argv: Sequence[str]) -> int:
    parser = ArgumentParser(prog="tms agent", description="Run one agent beside its sensor.")
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND")
    hand = kinds.add_parser("hand", help="tag reader of a robot's hand: LLRP, Takaya TR3, or a recording")
    hand.add_argument("--config", type=Path, required=True, metavar="FILE", help="TOML file")
    hand.add_argument("--once", action="store_true", help="with a capture: end when all of it has reached the server")
    hand.add_argument(
        "--timeout", type=float, default=60.0, metavar="S", help="with --once: wait this long for the server"
    )
    arguments = parser.parse_args(argv)
    config = read_config(arguments.config, HandConfig)
    if arguments.once and not isinstance(config.source, CaptureSource):
        raise CommandError("--once needs a source of kind capture: a reader has no end")
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s", stream=sys.stderr)
    logging.getLogger("httpx").setLevel(logging.WARNING)
    try:
        tally = asyncio.run(_until_signalled(config, arguments.once, arguments.timeout))
    except SpoolError as error:
        raise CommandError(str(error)) from error
    _say(config, tally)
    return 1 if arguments.once and (tally.waiting or tally.buried or tally.lost) else 0


async def _until_signalled(config: HandConfig, once: bool, timeout_s: float) -> Tally:
    """Run; SIGINT and SIGTERM end it as the end of the source does: the spool is closed in order."""
    drain_s = timeout_s if once else _STOP_S
    task = asyncio.ensure_future(run(config, once=once, drain_s=drain_s, progress=_progress()))
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, task.cancel)
    try:
        return await task
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(number)


def _progress() -> Callable[[Tally], None]:
    def show(tally: Tally) -> None:
        sys.stderr.write(f"\r{tally.reports} reports of {len(tally.tags)} tags, {tally.observations} observations ")

    return show if sys.stderr.isatty() else lambda tally: None


def _say(config: HandConfig, tally: Tally) -> None:
    sys.stdout.write(
        f"{config.agent}: {tally.reports} reports of {len(tally.tags)} tags, {tally.observations} observations, "
        f"{tally.buried} refused by the server, {tally.lost} lost, {tally.waiting} waiting in the spool"
        f"{f' ({tally.trouble})' if tally.trouble else ''}\n"
    )
