"""A reader's reports cut into looks: rounds where it tells them, short spans of time where it does not."""

from __future__ import annotations


class Looks:
    """Pure. A reader that does not deliver has no looks: then nothing can be said of tags that are not read."""

    def __init__(self, look_s: float) -> None:
        self.alive = False
        self._look_s = look_s
        self._rounds = False
        self._since = float("-inf")
        self._seen: set[str] = set()

    def read(self, t: float, tag: str) -> None:
        self.alive = True
        if not self._rounds and not self._seen:
            self._since = t
        self._seen.add(tag)

    def round_end(self, t: float) -> frozenset[str]:
        """What the round that ends now has shown."""
        self._rounds = self.alive = True
        return self._take(t)

    def ended(self, t: float) -> frozenset[str] | None:
        """What a span of time has shown, when it is over. A pause in our work is one look, not many."""
        if self._rounds or not self.alive or t - self._since < self._look_s:
            return None
        return self._take(t)

    def reader(self, t: float, alive: bool) -> bool:
        """The reader delivers, or not; True where that changed."""
        if alive == self.alive:
            return False
        self.alive, self._since = alive, t
        self._seen.clear()
        return True

    def _take(self, t: float) -> frozenset[str]:
        tags = frozenset(self._seen)
        self._seen.clear()
        self._since = t
        return tags
