"""When a step may still turn out to be something else: what to wait for before it is told."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tms_agents.cabinet.fusion import Explanation
from tms_agents.cabinet.naming import Namer
from tms_agents.cabinet.plateau import fits_none
from tms_agents.cabinet.position import centre_free
from tms_agents.cabinet.presence import Presence
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.stays import Shelf
from tms_agents.cabinet.steps import Step

#: How long a lifted thing's tag may stay in view in the hand.
IN_HAND_S = 0.8
#: Several at once are believed only at a level that is no pause between them.
_SEVERAL_S = 0.7
#: Rounds that must have told of a tag before its thing is one of several that changed at once.
_HEARD = 2
#: Rounds still to come may decide between explanations that are more probable than this.
_RIVAL = 0.02
#: A hand that presses does not hold for longer than this many times what it took to press so much of it.
_HELD, _PRESSED = 4.0, 0.85
#: Nearer than that to a thing it may be a hand that grips it.
_GRIP_M = 0.06
#: A load without a tag that is less probable than that may be something else.
_CLEARLY = 0.9
#: What is put so soon after something that does not weigh what its tag says may be the rest of it.
_REST_S = 8.0


class Caution:
    """Questions about a step and its ``explanations``, the most probable of them first."""

    def __init__(self, shelf: Shelf, presence: Presence, namer: Namer, settings: EstimatorSettings) -> None:
        self._shelf, self._presence, self._namer, self._settings = shelf, presence, namer, settings

    def unclear(self, step: Step, explanations: Sequence[Explanation]) -> bool:
        """Whether another moment, or another round, may tell something else."""
        best = explanations[0]
        if self._unheard(step, explanations):
            return True
        if not best.several:
            return best.score < 0.9 or not best.tight
        touched = best.removed if best.thing is None else (*best.removed, best.thing)
        tags = [thing.tag for thing in touched if thing.tag is not None]
        heard = all(self._heard(tag, step.settled) for tag in tags)
        return best.score < 0.97 or not heard or step.now - step.settled < _SEVERAL_S

    def may_be_an_arm(self, step: Step, best: Explanation) -> bool:
        """A new load without a tag, hardly steady yet or not as quiet as a thing: somebody may lean on it, or grip what
        stands there, or its tag is still to be read. What came quickly is steady soon."""
        if best.kind not in ("put", "two") or self._namer.loose():
            return False
        at, geometry = centre_free(step.change, self._shelf.geometry), self._shelf.geometry
        gripped = any(math.dist(at, thing.centre(geometry).xy) < _GRIP_M for thing in self._shelf.things.values())
        patience = self._settings.untagged_s
        if not gripped and not self._presence.undecided(step.onset):
            patience = min(patience, _HELD * _rise_s(step))
        return step.now - step.settled < patience or step.restless > self._settings.restless

    def may_be_pressed(self, step: Step, best: Explanation) -> bool:
        """A new load without a tag that has not been steady for long: what it weighs may be a hand's."""
        return best.kind == "put" and not self._namer.loose() and step.now - step.settled < self._settings.untagged_s

    def odd(self, step: Step, best: Explanation) -> bool:
        """Not what the tags tell, or hardly more probable than something else: all that happened may know better."""
        loose = self._namer.loose()
        if fits_none(best, step, loose) or self._may_be_the_rest(step, best):
            return True
        return best.kind == "put" and best.score < _CLEARLY and not loose

    def _may_be_the_rest(self, step: Step, best: Explanation) -> bool:
        """Whether something that does not weigh what its tag says has just been put, so that this may be more of it."""
        if best.kind not in ("put", "swap", "two"):
            return False
        recent = [thing for thing in self._shelf.things.values() if step.onset - thing.since < _REST_S]
        return any(self._namer.misfits(thing) for thing in recent)

    def _unheard(self, step: Step, explanations: Sequence[Explanation]) -> bool:
        """Whether rounds that are still to come may decide between the best explanations."""
        rivals = [item for item in explanations if item.score > _RIVAL]
        tags = {thing.tag for item in rivals for thing in item.removed if thing.tag is not None}
        return len(rivals) > 1 and not all(self._heard(tag, step.settled) for tag in tags)

    def _heard(self, tag: str, since: float) -> bool:
        """Whether the rounds have told if the tag has gone; one that is read may be in the hand at first."""
        read, missed = self._presence.rounds(tag, since)
        return (read == 0 and missed >= _HEARD) or any(self._presence.rounds(tag, since + IN_HAND_S))


def _rise_s(step: Step) -> float:
    """How long the load took to be nearly what it is now."""
    if not len(step.path):
        return 0.0
    share = step.path @ step.change / float(step.change @ step.change)
    rising = np.flatnonzero(share < _PRESSED)
    # The last of these blocks is where it got there: half of that, on average.
    return (float(rising[-1]) + 0.5) / len(step.path) * (step.settled - step.onset) if len(rising) else 0.0
