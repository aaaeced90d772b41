"""A reader's reports cut into looks: rounds where it tells them, short spans of time where it does not."""

from __future__ import annotations

#: Reads that wait for the end of their round for longer than this are a look of their own: some readers tell only the
#: rounds that found nothing.
_LONGEST_ROUND_S = 1.0


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
        if not self._seen:
            self._since = t
        self._seen.add(tag)

    def round_end(self, t: float) -> frozenset[str]:
        """What the round that ends now has shown."""
        self._rounds = self.alive = True
        return self._take(t)

    def ended(self, t: float) -> frozenset[str] | None:
        """What a span of time has shown, when it is over. A pause in our work is one look, not many."""
        if not self.alive or (self._rounds and not self._seen):
            return None
        if t - self._since < (_LONGEST_ROUND_S if self._rounds else self._look_s):
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
