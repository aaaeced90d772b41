"""SQL of the API keys."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import select, update
from sqlalchemy.ext.asyncio import AsyncSession

from tms_server.db.session import ReadOnlySession
from tms_server.db.tables import KeyRow


class KeyRepository:
    def __init__(self, session: AsyncSession | ReadOnlySession) -> None:
        self._session = session

    async def all(self) -> Sequence[KeyRow]:
        """Every key, revoked ones too, oldest first."""
        return (await self._session.scalars(select(KeyRow).order_by(KeyRow.created_at, KeyRow.id))).all()

    def add(self, row: KeyRow) -> None:
        self._session.add(row)

    async def revoke(self, key_id: str, at: int) -> bool:
        """Mark the key revoked (the first time counts). False where there is no such key."""
        if await self._session.get(KeyRow, key_id) is None:
            return False
        await self._session.execute(
            update(KeyRow).where(KeyRow.id == key_id, KeyRow.revoked_at.is_(None)).values(revoked_at=at)
        )
        return True
