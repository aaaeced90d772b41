"""Which of the tags in view is the one in the hand: a likelihood per tag, place by place.

A look is one completed round of the reader, or a short span of time of a reader that reports without rounds. A tag is
in the reader's field or not, by place: in the field it is read in a look with ``p_read``, elsewhere hardly ever
(``p_stray``). The tag in the hand is in the field wherever the hand goes, but for places where the thing, the hand or
the robot shades it (``shaded``). A neighbour is in the field where the hand closed, among the things of a shelf, with
probability ``near``, and at any other place with ``passing``. So many looks at one place say little, and some looks at
several places say much. With h reads in n looks at a place, A = p_read^h (1 - p_read)^(n-h) and B likewise of p_stray,

  P(looks | held) / P(looks | neighbour) = ((1 - shaded) A + shaded B) / (q A + (1 - q) B)   with q = near or passing.

"Nothing that can be read is in the hand" is one more hypothesis (``p_none``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Bound of the log-likelihood ratio: what was seen long ago must not outweigh for ever what is seen now.
_MOST = 8.0
_MOST_TAGS = 200


@dataclass(frozen=True, kw_only=True, slots=True)
class ReadModel:
    """Probabilities; see above."""

    p_read: float = 0.8
    p_stray: float = 0.02
    shaded: float = 0.15
    near: float = 0.5
    passing: float = 0.1
    p_none: float = 0.1


class TagEvidence:
    """Pure. ``begin`` when the hand closes, ``look`` for each look, ``elsewhere`` when the hand is at another place."""

    def __init__(self, model: ReadModel | None = None) -> None:
        self._model = model or ReadModel()
        self.begin()

    def begin(self) -> None:
        """Another thing may be in the hand: nothing is known."""
        self._before: dict[str, float] = {}  # by tag, of the places before this one
        self._unseen = 0.0  # the same of a tag that was read at none of them
        self._reads: dict[str, int] = {}
        self._looks = 0
        self._in_field = self._model.near
        #: Looks since the hand closed, at all places.
        self.looks = 0

    def elsewhere(self) -> None:
        """The hand has come to another place."""
        ratios = self._ratios()
        self._unseen = _bounded(self._unseen + self._here(0))
        self._before, self._reads, self._looks = ratios, {}, 0
        self._in_field = self._model.passing

    def look(self, tags: frozenset[str]) -> None:
        """One look showed ``tags``."""
        for tag in tags:
            if tag in self._reads or tag in self._before or len(self._before) + len(self._reads) < _MOST_TAGS:
                self._reads[tag] = self._reads.get(tag, 0) + 1
        self._looks += 1
        self.looks += 1

    def seen_any(self) -> bool:
        return bool(self._before or self._reads)

    def best(self, but: frozenset[str] = frozenset()) -> tuple[str | None, float]:
        """The most probable content (None: nothing readable) and its probability; tags of ``but`` are elsewhere."""
        weights = {tag: math.exp(ratio) for tag, ratio in self._ratios().items() if tag not in but}
        if not weights:
            return None, 1.0
        none, prior = self._model.p_none, (1.0 - self._model.p_none) / len(weights)
        total = none + prior * sum(weights.values())
        tag = max(weights, key=lambda one: (weights[one], one))
        return (tag, prior * weights[tag] / total) if prior * weights[tag] >= none else (None, none / total)

    def _ratios(self) -> dict[str, float]:
        tags = self._before.keys() | self._reads.keys()
        return {
            tag: _bounded(self._before.get(tag, self._unseen) + self._here(self._reads.get(tag, 0)))
            for tag in sorted(tags)
        }

    def _here(self, reads: int) -> float:
        model, misses = self._model, self._looks - reads
        in_field = reads * math.log(model.p_read) + misses * math.log(1.0 - model.p_read)
        outside = reads * math.log(model.p_stray) + misses * math.log(1.0 - model.p_stray)
        most = max(in_field, outside)  # after many looks both are too small for a float
        a, b, q = math.exp(in_field - most), math.exp(outside - most), self._in_field
        held, neighbour = (1.0 - model.shaded) * a + model.shaded * b, q * a + (1.0 - q) * b
        return math.log(held / neighbour)


def _bounded(ratio: float) -> float:
    return max(-_MOST, min(_MOST, ratio))
