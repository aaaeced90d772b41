"""Since when the load is what it is now, and whether a load can be what has been brought."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tms_agents.cabinet.fusion import Explanation
from tms_agents.cabinet.geometry import KnownWeight
from tms_agents.cabinet.steps import Step

#: Steps are at one level as long as no cell differs by more than so many standard deviations, and g.
_SAME_SD, _SAME_G = 3.0, 3.0


class Plateau:
    """A step on offer begins anew at every restless moment; the level it is at may be older."""

    def __init__(self) -> None:
        self._first: Step | None = None

    def since(self, step: Step) -> float:
        """When the load came to the level of ``step``; ask for every step that is offered."""
        if self._first is None or step.settled < self._first.settled or not _same(self._first, step):
            self._first = step
        return self._first.settled


def _same(one: Step, other: Step) -> bool:
    far, spread = one.change - other.change, one.variance + other.variance
    level = bool((one.before == other.before).all())
    return level and bool((abs(far) < _SAME_SD * spread**0.5 + _SAME_G).all())


def fits_none(best: Explanation, step: Step, loose: Mapping[str, KnownWeight | None]) -> bool:
    """Whether what an explanation puts is none of the things with the ``loose`` tags, all of whose weights are known.

    Of two that are put, both must be others of them, or one where there is only one.
    """
    if best.load is None or best.kind not in ("put", "swap", "two") or None in loose.values() or not loose:
        return False
    variance = step.variance if best.variance is None else best.variance
    sd = math.sqrt(float(variance.sum()))
    loads = [best.load] if best.second is None else [best.load, best.second]
    fitting = [{tag for tag, known in loose.items() if known and _fits(float(one.sum()), sd, known)} for one in loads]
    return len(set().union(*fitting)) < min(len(loads), len(loose))


def _fits(weight_g: float, sd_g: float, known: KnownWeight) -> bool:
    return abs(weight_g - known.mean_g) < 4 * math.hypot(sd_g, known.sd_g) + 2.0
