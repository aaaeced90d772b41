"""The keys of the database in memory, read again when they are a second old: revocation is felt at once."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from tms_server.db.session import Sessions
from tms_server.keys.repository import KeyRepository
from tms_server.keys.scopes import Principal
from tms_server.keys.service import matches, parse_key

MAX_AGE_S = 1.0


@dataclass(frozen=True, slots=True)
class _Held:
    digest: bytes
    principal: Principal


class KeyRing:
    """Answers whose key a text is, without a database round trip per request."""

    def __init__(self, sessions: Sessions, *, max_age_s: float = MAX_AGE_S) -> None:
        self._sessions = sessions
        self._max_age_s = max_age_s
        self._read_at: float | None = None
        self._held: dict[str, _Held] = {}
        self._any = False
        self._lock = asyncio.Lock()

    async def find(self, text: str) -> Principal | None:
        """The owner of the key ``text``; None where it is no key, unknown, or revoked."""
        await self._refresh()
        parsed = parse_key(text)
        if parsed is None:
            return None
        key_id, secret = parsed
        held = self._held.get(key_id)
        return held.principal if matches(secret, held.digest if held else None) and held else None

    async def is_empty(self) -> bool:
        """True where no key was ever made. Revoking the last one does not open the server again."""
        await self._refresh()
        return not self._any

    async def _refresh(self) -> None:
        if not self._is_old():
            return
        async with self._lock:
            if not self._is_old():
                return
            now = asyncio.get_running_loop().time()
            async with self._sessions.read() as session:
                rows = await KeyRepository(session).all()
            self._any = bool(rows)
            self._held = {
                row.id: _Held(row.digest, Principal(key=row.id, name=row.name, scopes=frozenset(row.scopes.split())))
                for row in rows
                if row.revoked_at is None
            }
            self._read_at = now

    def _is_old(self) -> bool:
        return self._read_at is None or asyncio.get_running_loop().time() - self._read_at > self._max_age_s
