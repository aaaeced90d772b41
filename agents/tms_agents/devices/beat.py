"""The beat on which boards of load cells are asked, and on which timers that may be a little late ring together.

It is uneven on purpose. A compressor that shakes a board at nearly the rate at which the board is asked looks like a
slow swing of the load, which no average removes. So the moment within each period is one of four quarters, and every
four periods have all four, in random order: shaking at one, two or three times the rate cancels within four samples,
and near these it is noise that averages out (Shapiro and Silverman 1960, "Alias-free sampling of random noise").

All who wait wait for the same moments, because waking up a computer costs more than most of what is done then.
"""

from __future__ import annotations

import asyncio
import math
import random

BEAT_S = 0.02

_QUARTERS = 4


def _offsets(groups: int, chance: random.Random) -> tuple[float, ...]:
    return tuple(q / _QUARTERS for _ in range(groups) for q in chance.sample(range(_QUARTERS), _QUARTERS))


#: Where in its period each moment is, again and again: 41 s at 50 Hz. A table, the same in every process: all must
#: wait for the same moments.
_OFFSETS = _offsets(512, random.Random(1960))
#: A timer that rings so much of a period early is on the beat.
_EARLY = 1e-3


def moment(number: int, period_s: float = BEAT_S) -> float:
    """When beat ``number`` is, seconds: within ``[number, number + 1)`` periods."""
    return (number + _OFFSETS[number % len(_OFFSETS)]) * period_s


def next_moment(after: float, period_s: float = BEAT_S) -> float:
    """The first moment of the beat after a time, seconds."""
    early = _EARLY * period_s
    number = math.floor((after + early) / period_s)
    this = moment(number, period_s)
    return this if this > after + early else moment(number + 1, period_s)


def on_the_beat(when: float, wait_s: float) -> float:
    """``when``, or the moment after it where the wait of ``wait_s`` seconds is not shorter than a beat."""
    return when if wait_s < BEAT_S else next_moment(when - 2 * _EARLY * BEAT_S)


async def sleep_to_the_beat(seconds: float) -> None:
    """At least about so many seconds, at most two beats more."""
    now = asyncio.get_running_loop().time()
    await asyncio.sleep(on_the_beat(now + seconds, seconds) - now)
