"""``tms agent``: one agent on a sensor host."""

from __future__ import annotations

import argparse
import gc
import logging
import sys
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from typing import Any, TypeVar

from tms_agents.config import AgentConfig, read_config
from tms_agents.devices import waiting
from tms_agents.hand.config import HandConfig
from tms_agents.hand.runner import Tally
from tms_agents.hand.runner import run as run_hand
from tms_agents.readers import CaptureSource
from tms_agents.running import Posted, until_signalled
from tms_client.cli import ArgumentParser, CommandError
from tms_client.errors import SpoolError

_STOP_S = 2.0  # for what still waits when the agent is asked to stop; the rest stays in the spool
P = TypeVar("P", bound=Posted)


def main(argv: Sequence[str]) -> int:
    parser = ArgumentParser(prog="tms agent", description="Run one agent beside its sensor.")
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND")
    hand = _kind(kinds, "hand", "a robot's hands, or a tag reader: LLRP, Takaya TR3, ThingMagic, a recording", _hand)
    hand.add_argument("--once", action="store_true", help="with a capture: end when all of it has reached the server")
    hand.add_argument(
        "--timeout", type=float, default=60.0, metavar="S", help="with --once: wait this long for the server"
    )
    _kind(kinds, "cabinet", "smart cabinet: boards with load cells or scales, and tag readers", _cabinet)
    _kind(kinds, "floor", "lasers over the floor: Hokuyo SCIP, SICK LMS2xx, TiM, LMS1xx, LMS5xx", _floor)
    _kind(kinds, "robot", "a robot that maps while it drives: a recorded drive, or laser, wheels, tag reader", _robot)
    arguments = parser.parse_args(argv)
    done: int = arguments.work(arguments)
    return done


def _kind(kinds: Any, name: str, text: str, work: Callable[[argparse.Namespace], int]) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = kinds.add_parser(name, help=text)
    parser.add_argument("--config", type=Path, required=True, metavar="FILE", help="TOML file")
    parser.set_defaults(work=work)
    return parser


def _hand(arguments: argparse.Namespace) -> int:
    config = read_config(arguments.config, HandConfig)
    if arguments.once and not isinstance(config.source, CaptureSource):
        raise CommandError("--once needs a source of kind capture: a reader has no end")
    drain_s = arguments.timeout if arguments.once else _STOP_S
    tally = _run(config, run_hand(config, once=arguments.once, drain_s=drain_s, progress=_progress()))
    return 1 if arguments.once and (tally.waiting or tally.buried or tally.lost) else 0


def _cabinet(arguments: argparse.Namespace) -> int:
    from tms_agents.cabinet.calibration_file import read_calibration
    from tms_agents.cabinet.config import CabinetConfig
    from tms_agents.cabinet.runner import require_calibration
    from tms_agents.cabinet.runner import run as run_cabinet

    config = read_config(arguments.config, CabinetConfig)
    calibrations = read_calibration(config.calibration_path(arguments.config))
    require_calibration(config, calibrations)
    _run(config, run_cabinet(config, calibrations, drain_s=_STOP_S))
    return 0


def _floor(arguments: argparse.Namespace) -> int:
    try:
        from tms_agents.floor.calibration.poses import calibrated
        from tms_agents.floor.config import FloorConfig
        from tms_agents.floor.runner import run as run_floor
    except ImportError as error:
        if error.name is None or error.name.startswith("tms_"):
            raise
        raise CommandError(f'the floor agent needs {error.name}: pip install "robot-town-tms[slam]"') from error

    config, poses = calibrated(read_config(arguments.config, FloorConfig), arguments.config)
    _run(config, run_floor(config, poses, drain_s=_STOP_S))
    return 0


def _robot(arguments: argparse.Namespace) -> int:
    try:
        from tms_agents.commands.slam_log import load
        from tms_agents.robot.config import RobotConfig
        from tms_agents.robot.objects_runner import robot_of
        from tms_agents.robot.objects_runner import run as run_with_objects
        from tms_agents.robot.runner import run as run_robot
    except ImportError as error:
        if error.name is None or error.name.startswith("tms_"):
            raise
        raise CommandError(f'the robot agent needs {error.name}: pip install "robot-town-tms[slam]"') from error

    config = read_config(arguments.config, RobotConfig)
    if config.objects is not None:
        source = config.source or config.live
        assert source is not None
        _run(config, run_with_objects(config, robot_of(source), drain_s=_STOP_S))
        return 0
    assert config.source is not None
    recorded = load(config.source.path, config.source.models)
    _run(config, run_robot(config, recorded, drain_s=_STOP_S))
    return 0


def _run(config: AgentConfig, work: Coroutine[Any, Any, P]) -> P:
    """Log to stderr, work until a signal, say at the end what was done."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s", stream=sys.stderr)
    logging.getLogger("httpx").setLevel(logging.WARNING)
    gc.collect()
    gc.freeze()  # what is loaded by now stays: no need to look through it again and again
    try:
        posted: P = waiting.run(until_signalled(work))
    except SpoolError as error:
        raise CommandError(str(error)) from error
    sys.stdout.write(f"{config.agent}: {posted.in_words()}\n")
    return posted


def _progress() -> Callable[[Tally], None]:
    def show(tally: Tally) -> None:
        sys.stderr.write(f"\r{tally.reports} reports of {len(tally.tags)} tags, {tally.observations} observations ")

    return show if sys.stderr.isatty() else lambda tally: None
