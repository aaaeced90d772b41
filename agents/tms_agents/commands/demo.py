"""``tms demo``: a server, a simulated room and its agents, playing the paper's experiment."""

from __future__ import annotations

import sys
from argparse import BooleanOptionalAction
from collections.abc import Sequence
from pathlib import Path

from tms_agents.simulation.demo import Plan, run
from tms_agents.simulation.leaving import Leaving
from tms_agents.simulation.robot_demo import run as run_robot
from tms_agents.simulation.terminal import Terminal
from tms_client.cli import ArgumentParser, CommandError


def main(argv: Sequence[str]) -> int:
    parser = ArgumentParser(
        prog="tms demo",
        description="Play the paper's experiment: ten objects, three smart cabinets, a person and a robot.",
    )
    parser.add_argument("--once", action="store_true", help="leave after the story; exit status 1 if a pie is off")
    parser.add_argument(
        "--weights", action="store_true", help="register and measure weights: how much sooner they know"
    )
    parser.add_argument(
        "--speed",
        type=_speed,
        default=1.0,
        metavar="S",
        help="people and robot move S times faster (default 1); boards, readers and agents keep real time",
    )
    parser.add_argument(
        "--laser",
        action=BooleanOptionalAction,
        help="an emulated laser and its agent see the floor, or a floor sensor without device does "
        "(default: the laser, where people walk as people do: --speed 0.5 to 1.25)",
    )
    parser.add_argument(
        "--robot",
        action="store_true",
        help="another story: a robot maps a ward with laser, wheels and tag reader while doors are moved",
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the sensors' noise (default 0)")
    parser.add_argument("--url", help="use this running server instead of starting one")
    parser.add_argument("--key", help="API key for --url (scope admin)")
    parser.add_argument("--room", default="demo", help="id of the room (default demo)")
    parser.add_argument("--port", type=int, help="port of the server, 0 for a free one (default: 8080 if it is free)")
    parser.add_argument("--data-dir", type=Path, help="keep the server's data here (default: thrown away)")
    arguments = parser.parse_args(argv)
    if arguments.url and (arguments.port is not None or arguments.data_dir):
        raise CommandError("--port and --data-dir are for a server of our own, not with --url")
    if arguments.seed < 0:
        raise CommandError(f"--seed must not be negative, got {arguments.seed}")
    leaving = Leaving()
    leaving.listen()
    try:
        robot = vars(arguments).pop("robot")
        if robot and (arguments.weights or arguments.laser is not None):
            raise CommandError("--weights and --laser belong to the other story, not to --robot")
        tell = run_robot if robot else run
        return 0 if tell(Plan(**vars(arguments)), Terminal(sys.stdout), sleep=leaving.sleep) else 1
    except KeyboardInterrupt:
        sys.stdout.write("\n")
        return 0 if not arguments.once else 130


def _speed(text: str) -> float:
    speed = float(text)
    if not 0.05 <= speed <= 1000.0:
        raise ValueError(text)
    return speed
