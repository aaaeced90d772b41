"""``tms placement replay``: what a belief filter makes of a scenario file, event by event."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tms_client.cli import ArgumentParser, CommandError
from tms_server.compiled import use_compiled_cache


def main(argv: Sequence[str]) -> int:
    parser = ArgumentParser(prog="tms placement", description="Replay scenarios through the belief engine.")
    replay = parser.add_subparsers(dest="action", required=True).add_parser(
        "replay", help="write the belief after every event of a scenario"
    )
    replay.add_argument("scenario", type=Path, metavar="SCENARIO.json", help="format placement-events/1")
    replay.add_argument("--filter", choices=("paper", "exact", "particle"), default="particle")
    replay.add_argument("--variant", choices=("full", "paper"), default="full", help="parameter set of the scenario")
    replay.add_argument(
        "--particles",
        type=_positive,
        metavar="N",
        help="hypotheses kept (particle, default 1000) or individuals (paper, default 10000)",
    )
    replay.add_argument("--seed", type=int, default=0, help="of the random draws (default 0)")
    replay.add_argument("--out", type=Path, required=True, metavar="OUT.json")
    args = parser.parse_args(argv)
    try:
        text = args.scenario.read_bytes()
    except OSError as error:
        raise CommandError(f"{args.scenario}: {error.strerror}") from error
    result = _replay(text, args)
    try:
        args.out.write_text(json.dumps(result, allow_nan=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise CommandError(f"{args.out}: {error.strerror}") from error
    return 0


def _replay(text: bytes, args: Any) -> dict[str, Any]:
    from pydantic import ValidationError

    from tms_schemas.scenario import read_scenario

    try:
        scenario = read_scenario(text)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise CommandError(f"{args.scenario}: {where + ': ' if where else ''}{first['msg']}") from error

    default = Path.home() / ".cache" / "tms"
    use_compiled_cache(Path(os.environ.get("TMS_DATA_DIR", default)))
    # numba reads its cache directory when it is imported, so not before this line.
    from tms_server.placement.replay import replay
    from tms_server.placement.warm import warm_up

    if args.filter != "paper":
        warm_up(_say)
    try:
        return replay(scenario, args.filter, args.variant, args.particles, args.seed, _progress(len(scenario.events)))
    except ValueError as error:
        raise CommandError(f"{args.scenario}: {error}") from error


def _say(message: str) -> None:
    sys.stderr.write(f"tms: {message}\n")


def _progress(total: int) -> Any:
    if not sys.stderr.isatty():
        return lambda done: None

    def show(done: int) -> None:
        sys.stderr.write(f"\r{done}/{total} events" + ("\n" if done == total else ""))

    return show


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise ValueError(text)
    return number
