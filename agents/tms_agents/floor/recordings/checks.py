"""What no laser can have measured, so that a file with wrong units or numbers is refused and not silently empty."""

from __future__ import annotations

import numpy as np

from tms_agents.devices.scans import Array, Sweep

#: No laser for a room reaches so far; ranges that mostly do are millimetres.
_FAR_M = 1000.0
#: Times between scans that were recorded by a busy computer wander by so much.
_LONGER = 1.1


def period_of(t: Array) -> float:
    """Seconds from scan to scan, as they mostly are."""
    steps = np.diff(t)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.1


def check_ranges(ranges: Array) -> None:
    """Raises ValueError where they cannot be metres, or say nothing."""
    if ranges.size and np.isnan(ranges).all():
        raise ValueError("every range is nan")
    found = ranges[np.isfinite(ranges)]
    if found.size and (middle := float(np.median(found))) > _FAR_M:
        raise ValueError(f"half of the ranges are beyond {middle:.0f} m: they seem to be millimetres")


def check_times(sweep: Sweep) -> None:
    """Raises ValueError where no sweep can be timed like that."""
    step = sweep.time_increment_s
    if not 0 <= step < np.inf:
        raise ValueError(f"time_increment {step:g} s is no time from beam to beam")
    if (lasts := step * (len(sweep.angles) - 1)) > _LONGER * sweep.period_s:
        next_after = f"the next begins after {sweep.period_s:.3g} s"
        raise ValueError(f"time_increment {step:g} s: a sweep would last {lasts:.3g} s, and {next_after}")
