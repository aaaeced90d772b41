"""What a key allows: the scopes ``observe:<room>``, ``read:<room>`` (``*`` for every room) and ``admin``."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

ADMIN = "admin"
ANY = "*"
_SCOPE = re.compile(r"admin|(observe|read):(\*|[A-Za-z0-9][A-Za-z0-9._-]{0,63})")


def parse_scopes(scopes: Iterable[str]) -> frozenset[str]:
    """The set of scopes. Raises ``ValueError`` naming the first that is none, or where there are none."""
    found = frozenset(scopes)
    for scope in sorted(found):
        if not _SCOPE.fullmatch(scope):
            raise ValueError(f"{scope!r} is no scope; scopes are observe:<room>, read:<room> (or :*) and admin")
    if not found:
        raise ValueError("a key needs at least one scope: observe:<room>, read:<room> (or :*) or admin")
    return found


@dataclass(frozen=True, kw_only=True, slots=True)
class Principal:
    """Who is asking. ``key`` is the id of the key used, null on a loopback server without keys."""

    key: str | None
    name: str
    scopes: frozenset[str]

    @property
    def is_admin(self) -> bool:
        return ADMIN in self.scopes

    def may_read(self, room: str) -> bool:
        """May ask where things are in ``room``, and who holds them."""
        return self._has("read", room)

    def may_observe(self, room: str) -> bool:
        """May post observations into ``room`` and register objects there."""
        return self._has("observe", room)

    def may_see(self, room: str | None) -> bool:
        """May see the room's furniture and master data of its objects; what belongs to no room is for every key."""
        return room is None or self.may_read(room) or self.may_observe(room)

    def rooms(self) -> frozenset[str] | None:
        """The rooms for which ``may_see`` holds; None means all of them."""
        if self.is_admin:
            return None
        found = frozenset(scope.partition(":")[2] for scope in self.scopes)
        return None if ANY in found else found

    def _has(self, action: str, room: str) -> bool:
        return not self.scopes.isdisjoint((ADMIN, f"{action}:{ANY}", f"{action}:{room}"))
