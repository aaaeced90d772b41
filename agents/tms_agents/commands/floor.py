"""``tms floor``: replay recordings, watch the floor, find out where the lasers are, record what they see."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tms_agents.commands.floor_lasers import calibrate, record
from tms_agents.commands.floor_replay import replay
from tms_agents.commands.floor_watch import watch
from tms_client.cli import ArgumentParser


def main(argv: Sequence[str]) -> int:
    parser = ArgumentParser(prog="tms floor", description="Lasers over the floor: replay, watch, calibrate, record.")
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="COMMAND")
    _replay(_command(kinds, "replay", "what was on the floor after every scan of recordings", replay))
    _watch(_command(kinds, "watch", "see live what the lasers see, or what recordings hold", watch))
    _calibrate(_command(kinds, "calibrate", "find out where a laser is", calibrate))
    _record(_command(kinds, "record", "record what the lasers see", record))
    arguments = parser.parse_args(_joined(argv))
    done: int = arguments.work(arguments)
    return done


def _joined(argv: Sequence[str]) -> list[str]:
    """``--pose -1,2,0`` as ``--pose=-1,2,0``: argparse takes what begins with a minus for an option."""
    found: list[str] = []
    for one in argv:
        if found and found[-1] in ("--pose", "--outline") and re.match(r"-[\d.]", one):
            found[-1] += f"={one}"
        else:
            found.append(one)
    return found


def _command(kinds: Any, name: str, text: str, work: Callable[[argparse.Namespace], int]) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = kinds.add_parser(name, help=text)
    parser.set_defaults(work=work)
    return parser


def _replay(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scans", nargs="+", type=Path, metavar="SCANS", help=".npz, .scans, .csv, .bag, .db3, .mcap")
    parser.add_argument("--out", type=Path, required=True, metavar="OUT.json")
    parser.add_argument("--png", type=Path, metavar="FILE", help="a picture of all tracks")
    parser.add_argument("--seed", type=int, default=0, help="as all commands have it; nothing here is random")
    _of_recordings(parser)


def _watch(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scans", nargs="*", type=Path, metavar="SCANS", help="recordings instead of lasers")
    parser.add_argument("--png", type=Path, metavar="FILE", help="a picture into this file instead of the terminal")
    parser.add_argument("--once", action="store_true", help="show one picture and leave")
    parser.add_argument("--wait", type=float, default=3.0, metavar="S", help="with --once: look so long before")
    parser.add_argument("--speed", type=float, default=1.0, metavar="S", help="of recordings; 0: as fast as it goes")
    _of_recordings(parser)


def _of_recordings(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--config", type=Path, metavar="FILE", help="TOML file of an agent: scene, settings, poses")
    parser.add_argument(
        "--pose", action="append", metavar="X,Y,THETA", help="of each sensor, in the order of the files"
    )


def _calibrate(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--config", type=Path, required=True, metavar="FILE", help="TOML file of the agent")
    parser.add_argument("--laser", metavar="NAME", help="which laser, where there are several")
    parser.add_argument("--walkers", metavar="NAME", help="by people whom this laser, whose pose is known, sees, too")
    parser.add_argument("--outline", metavar="CORNERS", help="of the room: '0,0 6,0 6,5 0,5' (default: [scene] region)")
    parser.add_argument("--scans", nargs="+", type=Path, metavar="FILE", help="recordings instead of the lasers")
    parser.add_argument("--seconds", type=float, metavar="S", help="look so long (default 10, with --walkers 60)")
    parser.add_argument("--force", action="store_true", help="keep a pose that fits badly")


def _record(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--config", type=Path, required=True, metavar="FILE", help="TOML file of the agent")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.scans")
    parser.add_argument("--seconds", type=float, metavar="S", help="so long (default: until Ctrl-C)")
