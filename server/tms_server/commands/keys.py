"""``tms keys create|list|revoke``: API keys, written to the database directly, also while a server runs on it."""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path

from sqlalchemy.exc import SQLAlchemyError

from tms_client.cli import ArgumentParser, CommandError
from tms_server.clock import SystemClock
from tms_server.db.engine import create_engine
from tms_server.db.lock import DatabaseOwned, own_database
from tms_server.db.migrate import is_current, migrate
from tms_server.db.session import Sessions
from tms_server.db.times import from_us
from tms_server.errors import NotFound
from tms_server.keys.scopes import parse_scopes
from tms_server.keys.service import KeyService
from tms_server.settings import Settings


def main(argv: Sequence[str]) -> int:
    arguments = _parser().parse_args(argv)
    given = {name: getattr(arguments, name) for name in ("data_dir", "database_url")}
    try:
        settings = Settings(**{name: value for name, value in given.items() if value is not None})
        return asyncio.run(_run(settings, arguments))
    except (ValueError, NotFound, DatabaseOwned) as error:
        raise CommandError(str(error)) from error
    except (SQLAlchemyError, OSError) as error:
        raise CommandError(f"the database does not answer: {error}") from error


async def create(service: KeyService, arguments: argparse.Namespace) -> None:
    key = await service.create(arguments.name, arguments.scope)
    sys.stderr.write("Keep this key now; it is shown only once.\n")
    sys.stdout.write(f"{key}\n")


async def show(service: KeyService, _: argparse.Namespace) -> None:
    rows = [("id", "name", "scopes", "created", "revoked")]
    for key in await service.list():
        revoked = "" if key.revoked_at is None else f"{from_us(key.revoked_at):%Y-%m-%d %H:%M:%SZ}"
        rows.append((key.id, key.name, key.scopes, f"{from_us(key.created_at):%Y-%m-%d %H:%M:%SZ}", revoked))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        sys.stdout.write("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() + "\n")


async def revoke(service: KeyService, arguments: argparse.Namespace) -> None:
    await service.revoke(arguments.id)
    if all(key.revoked_at is not None for key in await service.list()):
        sys.stderr.write("No valid key is left: the server refuses every request until you create one.\n")


Action = Callable[[KeyService, argparse.Namespace], Awaitable[None]]


def _parser() -> argparse.ArgumentParser:
    where = ArgumentParser(add_help=False)
    where.add_argument("--data-dir", type=Path, help="where the embedded database lives, as for tms serve")
    where.add_argument("--database-url", help="postgresql://... instead of the embedded SQLite")
    parser = ArgumentParser(prog="tms keys", description="API keys of a server.")
    actions = parser.add_subparsers(required=True, metavar="create|list|revoke")
    making = actions.add_parser("create", parents=[where], help="make a key and print it once")
    making.add_argument("name", help="whose key it is, for the list")
    making.add_argument(
        "--scope", action="append", required=True, help="observe:ROOM, read:ROOM (ROOM may be *) or admin; repeatable"
    )
    making.set_defaults(action=create)
    actions.add_parser("list", parents=[where], help="show all keys").set_defaults(action=show)
    revoking = actions.add_parser("revoke", parents=[where], help="refuse a key from now on")
    revoking.add_argument("id", help="the id that list shows (the middle part of the key)")
    revoking.set_defaults(action=revoke)
    return parser


async def _run(settings: Settings, arguments: argparse.Namespace) -> int:
    if arguments.action is create:
        parse_scopes(arguments.scope)  # before a wrong scope makes a database
    settings.data_dir.mkdir(parents=True, exist_ok=True)
    engine = create_engine(settings.url())
    action: Action = arguments.action
    try:
        if not await is_current(engine):
            async with own_database(engine):
                await migrate(engine)
        async with Sessions(engine).write() as session:
            await action(KeyService(session, SystemClock()), arguments)
            await session.commit()
    finally:
        await engine.dispose()
    return 0
