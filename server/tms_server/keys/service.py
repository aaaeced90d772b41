"""Make, list and revoke keys. A key's text is ``tms_<id>_<secret>``; only a digest of the secret is kept."""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from collections.abc import Iterable, Sequence

from sqlalchemy.ext.asyncio import AsyncSession

from tms_server.clock import Clock
from tms_server.db.tables import KeyRow
from tms_server.db.times import to_us
from tms_server.errors import NotFound
from tms_server.keys.repository import KeyRepository
from tms_server.keys.scopes import parse_scopes

_KEY = re.compile(r"tms_([0-9a-f]{8})_([0-9a-f]{64})")
_NOBODY = bytes(32)


class KeyService:
    def __init__(self, session: AsyncSession, clock: Clock) -> None:
        self._keys = KeyRepository(session)
        self._clock = clock

    async def create(self, name: str, scopes: Iterable[str]) -> str:
        """A new key; its text is returned here and never again. Raises ``ValueError`` for a bad scope or name."""
        if not name.strip() or not name.isprintable() or len(name) > 200:
            raise ValueError("the name of a key is 1 to 200 printable characters")
        granted = parse_scopes(scopes)
        key_id, secret = secrets.token_hex(4), secrets.token_hex(32)
        self._keys.add(
            KeyRow(
                id=key_id,
                name=name.strip(),
                digest=digest(secret),
                scopes=" ".join(sorted(granted)),
                created_at=to_us(self._clock.now()),
                revoked_at=None,
            )
        )
        return f"tms_{key_id}_{secret}"

    async def list(self) -> Sequence[KeyRow]:
        return await self._keys.all()

    async def revoke(self, key_id: str) -> None:
        """Raises ``NotFound``; revoking twice is no error."""
        if not await self._keys.revoke(key_id, to_us(self._clock.now())):
            raise NotFound(f"there is no key {key_id!r}")


def digest(secret: str) -> bytes:
    """SHA-256: the secret is 256 random bits, so nothing slower is needed."""
    return hashlib.sha256(secret.encode()).digest()


def parse_key(text: str) -> tuple[str, str] | None:
    """(id, secret) of a key's text, None where it is none."""
    match = _KEY.fullmatch(text)
    return (match[1], match[2]) if match else None


def matches(secret: str, stored: bytes | None) -> bool:
    """Compare in constant time, with an unknown key (``stored`` None) as well."""
    same = hmac.compare_digest(digest(secret), stored or _NOBODY)
    return same and stored is not None
