"""Who is asking and what they may do."""

from __future__ import annotations

from tms_server.settings import Settings


async def any_keys(settings: Settings) -> bool:
    """True where the database holds a key that is not revoked."""
    return False
