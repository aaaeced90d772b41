"""``tms catalogue import``: send a product catalogue (CSV) to a server, and say what became of every row.

``tms catalogue models``: register things with their shapes, as a mapper's ``models.json`` has them.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import itertools
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from tms_client.cli import ArgumentParser, CommandError
from tms_client.commands import models
from tms_client.commands.options import add_server_options
from tms_client.errors import TownError
from tms_client.town import Town

#: Bytes per request: the server imports a part in one transaction, and bounds the size of a body.
PART_BYTES = 500_000
_TIMEOUT_S = 120.0


def main(argv: Sequence[str]) -> int:
    """Status 1 where rows were refused; they are named on stderr by line and reason, the others are stored."""
    parser = ArgumentParser(prog="tms catalogue", description="What a server knows of products and of shapes.")
    actions = parser.add_subparsers(required=True, metavar="import|models")
    models.add_options(actions.add_parser("models", help="register the things of a models.json with their shapes"))
    importing = actions.add_parser(
        "import", help="add products from a CSV file with the columns jan, name, size, weight_g, class, shape"
    )
    importing.add_argument("file", type=Path, help="UTF-8 or Shift_JIS, with a header row")
    add_server_options(importing)
    importing.set_defaults(run=_import_file)
    arguments = parser.parse_args(argv)
    done: int = arguments.run(arguments)
    return done


def _import_file(arguments: argparse.Namespace) -> int:
    try:
        body = arguments.file.read_bytes()
    except OSError as error:
        raise CommandError(f"{arguments.file}: {error.strerror}") from error
    return _import(body, arguments.url, arguments.key)


def _import(body: bytes, url: str, key: str | None) -> int:
    stored = refused = 0
    ignored: list[str] = []
    with Town(url, key, timeout_s=_TIMEOUT_S) as town:
        for part in split(body, PART_BYTES):
            try:
                result = town.products.import_csv(part.body)
            except TownError as error:
                raise CommandError(f"{error} ({stored} products stored before line {part.line})") from error
            stored += result.stored
            refused += len(result.refused)
            ignored = result.ignored_columns
            for problem in result.refused:
                sys.stderr.write(f"line {problem.line + part.shift}: {problem.reason}\n")
            if sys.stderr.isatty():
                sys.stderr.write(f"\r{stored} products stored\r")
    if ignored:
        sys.stderr.write(f"columns not imported: {', '.join(ignored)}\n")
    sys.stdout.write(f"{stored} products stored, {refused} rows refused\n")
    return 1 if refused else 0


class Part(NamedTuple):
    """A piece of a catalogue with its own header. Its line ``n`` is line ``n + shift`` of the file."""

    body: bytes
    line: int
    shift: int


def split(body: bytes, part_bytes: int) -> Iterator[Part]:
    """Cut between rows, never inside a quoted cell. What cannot be read stays whole: the server says why."""
    text = _decoded(body)
    if text is None or len(body) <= part_bytes:
        yield Part(body, 1, 0)
        return
    lines = list(io.StringIO(text, newline=""))  # the lines that the server counts
    reader = csv.reader(lines, strict=True)
    starts: list[int] = []
    with contextlib.suppress(csv.Error):  # the rest is one piece
        starts.extend(reader.line_num for _ in reader)
    header, size = (starts or [len(lines)])[0], 0
    begin = header
    for start, end in itertools.pairwise(starts):
        size += sum(len(line.encode()) for line in lines[start:end])
        if size >= part_bytes:
            yield _part(lines, header, begin, end)
            begin, size = end, 0
    if begin < len(lines) or begin == header:
        yield _part(lines, header, begin, len(lines))


def _part(lines: list[str], header: int, begin: int, end: int) -> Part:
    return Part("".join(lines[:header] + lines[begin:end]).encode(), begin + 1, begin - header)


def _decoded(body: bytes) -> str | None:
    for encoding in ("utf-8-sig", "cp932"):
        try:
            return body.decode(encoding)
        except UnicodeDecodeError:
            continue
    return None
