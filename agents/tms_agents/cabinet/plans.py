"""What may have happened since the board last rested, and how probable it is before the load is looked at."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from tms_agents.cabinet.geometry import KnownWeight
from tms_agents.cabinet.stays import Thing

#: Log-probability of so many changes between two rests; a thing that was put elsewhere is one change.
_CHANGES = [math.log(p) for p in (0.05, 0.75, 0.17, 0.02, 0.002, 1e-4, 1e-5)]
#: Nothing has changed, but something shakes the board.
_NOTHING = math.log(0.5)
#: How often a thing is also put elsewhere when others come or go.
_ASIDE = math.log(0.03)
#: A new thing has a tag or none. A tag in view may belong to something else,
_TAGGED, _UNTAGGED, _ELSEWHERE = math.log(0.8), math.log(0.2), math.log(0.03)
#: ... hardly to something else if it came into view together with the change.
_CAME_ELSEWHERE = math.log(0.004)
#: Up to so many things go at once, fewer where there are many.
_MOST_GONE, _FEWER_GONE, _MANY = 3, 2, 10

#: Log-likelihood of the rounds since the board rests, if the tag is there and if it is not.
TagOdds = Callable[[str], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Known:
    """What is known beside the load: ``tags`` in view, the rounds' ``odds`` of any tag, and what things weigh."""

    tags: Collection[str]
    odds: TagOdds
    weight: Callable[[str], KnownWeight | None]
    #: Something shakes the board, so that its level may swing.
    shaking: bool = False
    #: Tags that came into view together with the change.
    fresh: Collection[str] = ()
    #: Log-probability that the tag of something that was taken is still in view, in the hand.
    in_hand: float = math.log(0.2)


class Plan(NamedTuple):
    """``gone``: ids of things that stood there before; ``new``: tags of those that have come, None without one."""

    prior: float
    gone: frozenset[int]
    new: tuple[str | None, ...]


def plans_of(things: Sequence[Thing], known: Known) -> Iterator[Plan]:
    """Every plan with the log of its probability, not normalised: how often such things happen, and the rounds."""
    own = {thing.tag for thing in things if thing.tag is not None}
    odds = {tag: known.odds(tag) for tag in sorted(own.union(known.tags))}
    free = [tag for tag in odds if tag not in own]

    def elsewhere(tag: str) -> float:
        return known.in_hand if tag in own else _CAME_ELSEWHERE if tag in known.fresh else _ELSEWHERE

    astray = {tag: max(absent, elsewhere(tag) + present) for tag, (present, absent) in odds.items()}
    unmoved = sum(odds[tag][0] for tag in sorted(own)) + sum(astray[tag] for tag in free)
    most = min(_MOST_GONE if len(things) <= _MANY else _FEWER_GONE, len(things))
    for group in itertools.chain.from_iterable(itertools.combinations(things, n) for n in range(most + 1)):
        lifted = [tag for thing in group if (tag := thing.tag) is not None]
        untagged = len(group) - len(lifted)
        gone = frozenset(thing.id for thing in group)
        which = unmoved - len(group) * math.log(max(len(things), 1))
        which += sum(astray[tag] - odds[tag][0] for tag in lifted)
        choice: list[str | None] = [*free, *lifted, None, None]
        # Each once, though None stands in the list twice.
        for new in dict.fromkeys(itertools.chain.from_iterable(itertools.combinations(choice, n) for n in range(3))):
            without = sum(tag is None for tag in new)
            moved = sum(tag in lifted for tag in new) + min(untagged, without)
            prior = which + _usual(len(group) + len(new) - moved, moved, known.shaking)
            prior += max(without - untagged, 0) * _UNTAGGED
            prior += sum(odds[tag][0] - astray[tag] + _TAGGED for tag in new if tag is not None)
            yield Plan(prior, gone, new)


def _usual(changes: int, moved: int, shaking: bool) -> float:
    if shaking and not changes:
        return _NOTHING
    aside = max(moved - 1, 0) if changes == moved else moved
    return _CHANGES[min(changes, len(_CHANGES) - 1)] + aside * _ASIDE
