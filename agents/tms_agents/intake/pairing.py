"""Which scan belongs to which tag. Pure: times (seconds, monotone) come in, what to do comes out.

A barcode and a tag make a pair in whichever order they come, and each is used once. What is in doubt is never paired:

* an old scan: it expires, and a scan that failed takes the one before with it;
* a tag that may not be the one held: a tag counts when it was alone at the reader for ``settle_s``; after several, the
  reader must have been empty;
* a tag that waits, once any other tag was seen; a tag that was registered before, for good.
"""

from __future__ import annotations

from dataclasses import dataclass

_MOST_DONE = 10_000
_MOST_SEEN = 1_000


@dataclass(frozen=True, slots=True)
class Pair:
    """Register this; say ``failed`` if that does not work."""

    tag: str
    code: str


@dataclass(frozen=True, slots=True)
class Alone:
    """A tag without a scan: it waits for one, unless it needs none (say ``registered``)."""

    tag: str


@dataclass(frozen=True, slots=True)
class Again:
    """A tag that was registered before is at the reader."""

    tag: str


@dataclass(frozen=True, slots=True)
class Waiting:
    """A scan waits for its tag; ``instead_of`` is the one before, which is forgotten."""

    code: str
    instead_of: str | None = None


@dataclass(frozen=True, slots=True)
class Several:
    tags: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Expired:
    """The scan, or the tag, has waited too long and is forgotten."""

    code: str | None = None
    tag: str | None = None


Outcome = Pair | Alone | Again | Waiting | Several | Expired


@dataclass(slots=True)
class _Presence:
    first: float
    last: float
    told: bool = False


class Pairing:
    """One reader, one scanner, one carer.

    Args:
        expires_s: a scan or a tag waits at most this long for the other.
        settle_s: a tag at the reader counts when it was alone for this long.
        gone_s: a tag that was not read for this long is no more at the reader.
    """

    def __init__(self, *, expires_s: float = 60.0, settle_s: float = 0.5, gone_s: float = 2.0) -> None:
        self._expires_s, self._settle_s, self._gone_s = expires_s, settle_s, gone_s
        self._scan: tuple[str, float] | None = None
        self._tag: tuple[str, float] | None = None
        self._seen: dict[str, _Presence] = {}
        self._crowded = False
        self._done: dict[str, None] = {}

    def scanned(self, t: float, code: str) -> list[Outcome]:
        """A barcode with a right check digit."""
        found = self.tick(t)
        before, self._scan = self._scan, (code, t)
        if self._tag is not None:
            return [*found, self._pair(self._tag[0])]
        instead_of = before[0] if before is not None and before[0] != code else None
        return [*found, Waiting(code, instead_of)]

    def scan_failed(self) -> None:
        """Something was scanned that is no barcode: whatever it was, the scan before it was not meant any more."""
        self._scan = None

    def read(self, t: float, tag: str) -> list[Outcome]:
        """The reader sees a tag; call it for every read."""
        self._leave(t)
        self._forget_other(tag)
        known = self._seen.get(tag)
        if known is not None:
            known.last = t
        elif len(self._seen) < _MOST_SEEN:
            self._seen[tag] = _Presence(t, t)
        if self._tag is not None and self._tag[0] == tag:
            self._tag = (tag, t)
        return self.tick(t)

    def typed(self, t: float, tag: str) -> list[Outcome]:
        """A tag given by hand, or by a reader that says each tag once: nothing to wait for."""
        found = self.tick(t)
        self._forget_other(tag)
        for other, one in self._seen.items():  # what lies at the reader is not what is meant now
            one.told = one.told or other != tag
        return [*found, *self._present(t, tag)]

    def tick(self, t: float) -> list[Outcome]:
        """Time passes; call it several times a second."""
        self._leave(t)
        found: list[Outcome] = []
        if self._scan is not None and t - self._scan[1] > self._expires_s:
            found.append(Expired(code=self._scan[0]))
            self._scan = None
        if self._tag is not None and t - self._tag[1] > self._expires_s:
            found.append(Expired(tag=self._tag[0]))
            self._tag = None
        return found + self._look(t)

    def registered(self, tag: str) -> None:
        """The tag is settled: no scan will be given to it."""
        self._settle(tag)

    def failed(self, tag: str) -> None:
        """The pair was not registered: start over with this thing, tag and scan.

        Its tag does not wait for the next scan, which may well be that of the next thing; nor does another one, while
        this thing is at the reader.
        """
        if self._done.pop(tag, "") is None and tag in self._seen:
            self._forget_other(tag)

    def _look(self, t: float) -> list[Outcome]:
        """What is at the reader now."""
        new = [tag for tag in self._seen if tag not in self._done]
        if not new:
            self._crowded = False
            return self._done_ones(t)
        if len(new) > 1:
            found: list[Outcome] = [] if self._crowded else [Several(tuple(sorted(new)))]
            self._crowded, self._tag = True, None
            return found
        one = self._seen[new[0]]
        if self._crowded or one.told or t - one.first < self._settle_s:
            return []
        one.told = True
        waits = self._tag is not None and self._tag[0] == new[0]
        return [] if waits else self._present(t, new[0])

    def _done_ones(self, t: float) -> list[Outcome]:
        """Tags that come back after they were registered, each said once."""
        back = [tag for tag, one in self._seen.items() if not one.told and t - one.first >= self._settle_s]
        for tag in back:
            self._seen[tag].told = True
        return [Again(tag) for tag in back]

    def _present(self, t: float, tag: str) -> list[Outcome]:
        if tag in self._done:
            return [Again(tag)]
        if self._scan is not None:
            return [self._pair(tag)]
        self._tag = (tag, t)
        return [Alone(tag)]

    def _pair(self, tag: str) -> Pair:
        assert self._scan is not None
        pair = Pair(tag, self._scan[0])
        self._settle(tag)
        self._scan = None
        return pair

    def _settle(self, tag: str) -> None:
        self._done[tag] = None
        while len(self._done) > _MOST_DONE:
            del self._done[next(iter(self._done))]
        if self._tag is not None and self._tag[0] == tag:
            self._tag = None
        if tag in self._seen:
            self._seen[tag].told = True

    def _forget_other(self, tag: str) -> None:
        if self._tag is not None and self._tag[0] != tag and tag not in self._done:
            self._tag = None

    def _leave(self, t: float) -> None:
        for tag in [tag for tag, one in self._seen.items() if t - one.last > self._gone_s]:
            del self._seen[tag]
