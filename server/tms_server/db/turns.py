"""Registry writers take turns: objects, products and rooms change seldom, so a queue costs nothing and ends races."""

from __future__ import annotations

from sqlalchemy import text
from sqlalchemy.ext.asyncio import AsyncSession

#: Any constant that is not the one of db/lock.py.
_ADVISORY_KEY = 0x746D7301


async def take_turn(session: AsyncSession) -> None:
    """Wait for the other registry writers; the turn ends with the transaction.

    What is read after it stays true until the commit. SQLite needs nothing: its writing transactions exclude each
    other from their beginning. Observations do not wait here, only on the rows of the rooms that are written to.
    """
    if session.get_bind().dialect.name == "postgresql":
        await session.execute(text("select pg_advisory_xact_lock(:key)"), {"key": _ADVISORY_KEY})
