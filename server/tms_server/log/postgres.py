"""Appends to PostgreSQL: one connection held by the writer, bulk statements over arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from sqlalchemy.ext.asyncio import AsyncConnection, AsyncEngine

from tms_server.log import store
from tms_server.log.blocks import MOST_RECORDS
from tms_server.log.bodies import Content
from tms_server.log.plan import AgentFacts, Known, Plan, RoomFacts
from tms_server.log.record import Batch

_INSERT_LOG = f"""
insert into log ({store.LOG_COLUMNS}) select * from unnest(
    $1::text[], $2::bigint[], $3::text[], $4::bigint[], $5::bigint[], $6::bigint[], $7::bigint[], $8::bigint[],
    $9::bool[], $10::text[])
"""
_INSERT_AGENTS = f"""
insert into agents ({store.AGENT_COLUMNS}) select * from unnest(
    $1::text[], $2::text[], $3::bigint[], $4::bigint[], $5::bigint[], $6::bigint[], $7::bigint[], $8::text[],
    $9::text[])
{store.ON_AGENT_CONFLICT}"""
_INSERT_UNKNOWN = f"""
insert into unknown_tags as u ({store.UNKNOWN_COLUMNS}) select * from unnest(
    $1::text[], $2::text[], $3::text[], $4::bigint[], $5::bigint[], $6::bigint[], $7::text[], $8::float[], $9::float[])
{store.ON_UNKNOWN_CONFLICT}"""


class PostgresStore:
    def __init__(self, engine: AsyncEngine) -> None:
        self._engine = engine
        self._connection: AsyncConnection | None = None

    async def append(self, batches: Sequence[Batch], decide: Callable[[Known], Plan]) -> Plan:
        try:
            driver = await self._driver()
            async with driver.transaction(isolation="read_committed"):
                plan = decide(await _read(driver, batches))
                await _write(driver, plan)
            return plan
        except BaseException:
            await self._disconnect()
            raise

    async def close(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            await connection.close()

    async def _driver(self) -> Any:
        """The asyncpg connection under SQLAlchemy's, which stays out of the way: it never begins on this one."""
        if self._connection is None:
            self._connection = await self._engine.connect()
        return (await self._connection.get_raw_connection()).driver_connection

    async def _disconnect(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            await connection.invalidate()
            await connection.close()


async def _read(driver: Any, batches: Sequence[Batch]) -> Known:
    wanted = store.Wanted.by(batches)
    rooms = await driver.fetch(
        f"select {store.ROOM_COLUMNS} from rooms where room = any($1) order by room for update", wanted.rooms
    )
    facts = await driver.fetch(f"select {store.AGENT_COLUMNS} from agents where agent = any($1)", wanted.agents)
    agents = {row[0]: AgentFacts(*row) for row in facts}
    stored: dict[tuple[str, int], tuple[str, Content]] = {}
    for agent, seqs in store.repeated(batches, {a.agent: a.next_seq for a in agents.values()}).items():
        select = (
            f"select {store.LOG_COLUMNS} from log where agent = $1 and seq between $2 and $3 and seq + records > $4"
        )
        low, high = min(seqs), max(seqs)
        stored |= store.contents(await driver.fetch(select, agent, low - MOST_RECORDS + 1, high, low))
    select = "select room, tag from objects where tag = any($1)"
    registered = await driver.fetch(select, wanted.tags) if wanted.tags else []
    known = {room: RoomFacts(*facts) for room, *facts in rooms}
    return Known(known, agents, stored, {(room, tag) for room, tag in registered})


async def _write(driver: Any, plan: Plan) -> None:
    if plan.blocks:
        await driver.execute(_INSERT_LOG, *_columns(block for block, _ in plan.blocks))
        await driver.execute(
            "update rooms set head = new.head, newest_at = new.newest_at"
            " from unnest($1::text[], $2::bigint[], $3::bigint[]) as new (room, head, newest_at)"
            " where rooms.room = new.room",
            list(plan.rooms),
            *_columns(plan.rooms.values()),
        )
    if plan.agents:
        await driver.execute(_INSERT_AGENTS, *_columns(plan.agents.values()))
    if plan.unknown:
        await driver.execute(_INSERT_UNKNOWN, *_columns(plan.unknown.values()))


def _columns(rows: Iterable[tuple[Any, ...]]) -> list[list[Any]]:
    return [list(column) for column in zip(*rows, strict=True)]
