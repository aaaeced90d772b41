"""Timers of one process that may be a little late ring together: a computer that sleeps is woken once for all of them.

Waking up costs more than most of what is done then. The beat is that of a board of load cells read at its usual pace.
"""

from __future__ import annotations

import asyncio
import math

BEAT_S = 0.02


def on_the_beat(when: float, wait_s: float) -> float:
    """``when``, or the beat after it where the wait of ``wait_s`` seconds is not shorter than a beat."""
    return when if wait_s < BEAT_S else math.ceil(when / BEAT_S - 1e-3) * BEAT_S


async def sleep_to_the_beat(seconds: float) -> None:
    """At least about so many seconds, at most one beat more."""
    now = asyncio.get_running_loop().time()
    await asyncio.sleep(on_the_beat(now + seconds, seconds) - now)
