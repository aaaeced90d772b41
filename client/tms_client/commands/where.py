"""``tms where``: where an object probably is, in plain words."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from datetime import UTC, datetime

from tms_client.cli import ArgumentParser, CommandError
from tms_client.commands.options import add_server_options
from tms_client.errors import TownError
from tms_client.flows import Retry
from tms_client.town import Town


def main(argv: Sequence[str]) -> int:
    parser = ArgumentParser(prog="tms where", description="Say where an object probably is.")
    parser.add_argument("name", nargs="+", help="tag, name or synonym")
    parser.add_argument("--at", type=_time, help="ask about a moment in the past (RFC 3339)")
    parser.add_argument("--json", action="store_true", help="print the server's whole answer")
    add_server_options(parser)
    arguments = parser.parse_args(argv)
    try:
        with Town(arguments.url, arguments.key, retry=Retry(attempts=3)) as town:
            answer = town.where(" ".join(arguments.name), at=arguments.at)
    except TownError as error:
        raise CommandError(str(error)) from error
    sys.stdout.write(answer.model_dump_json(indent=2) + "\n" if arguments.json else answer.in_words())
    return 0


def _time(text: str) -> datetime:
    try:
        at = datetime.fromisoformat(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no time like 2026-11-20T10:00:00Z") from None
    return at if at.tzinfo else at.replace(tzinfo=UTC)
