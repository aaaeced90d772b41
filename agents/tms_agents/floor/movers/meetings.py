"""Who has stood with whom: one may have handed the other something, which no laser near the floor sees.

Who walks past, or beside somebody, hands over nothing; those who do stand within reach of each other for a moment. That
is told as soon as it is so, for when they had come to stand there; and once more when they part, because one may have
got hold of something meanwhile. Not in between, however long it takes: each time it is told the belief knows less who
holds what, and an hour beside a bed would leave nothing of it. Robots tell themselves what they hand over.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
from numba import njit

from tms_agents.floor.events import FloorEvent, Met, Vanished
from tms_agents.floor.feet.person import is_person
from tms_agents.floor.norm import norm
from tms_agents.floor.state import CONCEALED, NEVER

#: Two so near each other (m) reach each other; so far apart (m) they have parted.
_REACH_M, _PARTED_M = 1.2, 2.0
#: Within this (m) somebody stands where he stands; so long (s) both do before one may have handed over something.
_STANDS_M, _STANDS_S = 0.4, 2.0
#: Who stands together for no longer (s) than this after it was told has had no time to get something else.
_AGAIN_S = 10.0
#: It is looked who is near whom so often (s).
_LOOKS_S = 0.2

#: Two labels, how far they are from each other and where each of them is (m), and whether it is known where.
_PAIR = np.dtype(
    [("a", "i8"), ("b", "i8"), ("apart", "f8"), *[(name, "f8") for name in ("ax", "ay", "bx", "by")], ("known", "?")]
)


@dataclass(slots=True)
class _Meeting:
    """Of two labels: since when they have stood (s), where (m), when they were last seen to, and until when it is told.

    ``told`` NEVER: they have only come near each other so far.
    """

    since: float
    ax: float
    ay: float
    bx: float
    by: float
    last: float = NEVER
    told: float = NEVER


class Meetings:
    """Of all pairs of people; so many bodies at ``most``."""

    def __init__(self, most: int) -> None:
        self._meetings: dict[tuple[int, int], _Meeting] = {}
        self._pairs = np.zeros(most * (most - 1) // 2, _PAIR)
        self._looked = NEVER

    def look(self, bodies: Any, t: float) -> list[Met]:
        """Who stands with whom, and who has parted: what is to be told."""
        if t - self._looked < _LOOKS_S:
            return []
        self._looked = t
        found: list[Met] = []
        near = set()
        for a, b, apart, ax, ay, bx, by, known in self._pairs[: _near(bodies, self._pairs)].tolist():
            near.add((a, b))
            if not known:
                continue  # who is hidden has not gone, nor does he stand
            meeting = self._meetings.setdefault((a, b), _Meeting(t, ax, ay, bx, by))
            strayed = math.dist((ax, ay), (meeting.ax, meeting.ay)), math.dist((bx, by), (meeting.bx, meeting.by))
            if apart > _REACH_M or max(strayed) > _STANDS_M:
                meeting.since, meeting.ax, meeting.ay, meeting.bx, meeting.by = t, ax, ay, bx, by
            elif t - meeting.since >= _STANDS_S:
                meeting.last = t
                if meeting.told == NEVER:
                    found.append(self._tell((a, b), t, meeting.since))
        return found + [one for pair in sorted(self._meetings.keys() - near) for one in self._end(pair, t)]

    def gone(self, events: Iterable[FloorEvent], t: float) -> list[Met]:
        """What is to be told of those who have vanished, before nothing is known of them any more."""
        gone = [event for event in events if isinstance(event, Vanished)]
        pairs = [(pair, event) for event in gone for pair in sorted(self._meetings) if event.label in pair]
        found: list[Met] = []
        for pair, event in pairs:
            if pair in self._meetings:
                found += self._end(pair, t) if event.into is None else self._go_on(pair, event.label, event.into)
        return found

    def save(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "looked": self._looked,
            "meetings": [[*pair, *astuple(meeting)] for pair, meeting in self._meetings.items()],
        }

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        self._looked = float(saved["looked"])
        self._meetings = {
            (int(a), int(b)): _Meeting(*map(float, (since, ax, ay, bx, by, last, told)))
            for a, b, since, ax, ay, bx, by, last, told in saved["meetings"]
        }

    def _tell(self, pair: tuple[int, int], t: float, since: float) -> Met:
        self._meetings[pair].told = t
        return Met(t, *pair, since)

    def _end(self, pair: tuple[int, int], t: float) -> list[Met]:
        """They have parted: what one got hold of while they stood there may be with the other one, too."""
        meeting = self._meetings[pair]
        again = meeting.told != NEVER and meeting.last - meeting.told > _AGAIN_S
        found = [self._tell(pair, t, meeting.last)] if again else []
        del self._meetings[pair]
        return found

    def _go_on(self, pair: tuple[int, int], label: int, into: int) -> list[Met]:
        """Who had this label is somebody who was there before, and stands there still."""
        meeting, other = self._meetings.pop(pair), pair[0] + pair[1] - label
        if other != into:
            self._meetings.setdefault((min(other, into), max(other, into)), meeting)
        return []


@njit(cache=True)
def _near(bodies: Any, pairs: Any) -> int:
    """Fill ``pairs`` with those people who have not parted: how many."""
    count = 0
    for i in range(bodies.size):
        for j in range(i):
            one, two = bodies[j], bodies[i]
            if not (is_person(one) and is_person(two)):
                continue
            apart = norm(one.x - two.x, one.y - two.y)
            if apart < _PARTED_M:
                if one.label > two.label:
                    one, two = two, one
                pair = pairs[count]
                pair.a, pair.b, pair.apart = one.label, two.label, apart
                pair.ax, pair.ay, pair.bx, pair.by = one.x, one.y, two.x, two.y
                pair.known = one.stale != CONCEALED and two.stale != CONCEALED
                count += 1
    return count
