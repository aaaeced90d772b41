"""Where no beam brings anything: something black or glossy may be there, something faint, or nothing."""

from __future__ import annotations

import numpy as np
from numba import njit

from tms_agents.floor.norm import norm
from tms_agents.floor.scan.freespace import Sight, beam_of

#: What stands at a place is met within this (m) before or behind it.
_DEEP_M = 0.1


@njit(cache=True)
def silent(x: float, y: float, half: float, sight: Sight) -> bool:
    """Whether half of the beams to (x, y) ± half m echo nothing, though the background there does: black or glossy."""
    ranges, _, steady, _, _, _ = sight
    away, low, high = _towards(x, y, half, sight)
    count = 0
    for i in range(low, high + 1):
        if not np.isfinite(ranges[i]) and np.isfinite(steady[i]) and steady[i] > away:
            count += 1
    return bool(count > 0 and 2 * count >= high - low + 1)


@njit(cache=True)
def blank(x: float, y: float, half: float, sight: Sight) -> bool:
    """Whether no beam to (x, y) ± half m echoes anything, nor does the background there, mostly."""
    ranges, _, steady, _, _, _ = sight
    _, low, high = _towards(x, y, half, sight)
    for i in range(low, high + 1):
        if not np.isinf(ranges[i]) or np.isfinite(steady[i]):
            return False
    return bool(high >= low)


@njit(cache=True)
def vacant(x: float, y: float, half: float, sight: Sight) -> bool:
    """Whether nothing speaks for something at (x, y) ± half m: beams pass, or are stopped before; none falls silent."""
    ranges, _, steady, _, _, _ = sight
    away, low, high = _towards(x, y, half, sight)
    passes = 0
    for i in range(low, high + 1):
        known = np.isfinite(ranges[i])
        if (known and abs(ranges[i] - away) > _DEEP_M) or (not known and not np.isfinite(steady[i])):
            passes += 1
    return bool(2 * passes >= high - low + 1)


@njit(cache=True)
def _towards(x: float, y: float, half: float, sight: Sight) -> tuple[float, int, int]:
    """How far (x, y) is, m, and the first and last of the beams that meet it ± half m (0 and -1: none)."""
    ranges, _, _, pose, first, step = sight
    n = ranges.size
    away = norm(x - pose[0], y - pose[1])
    middle = beam_of(np.arctan2(y - pose[1], x - pose[0]) - pose[2], first, step, n)
    if np.isnan(middle):
        return away, 0, -1
    reach = np.arctan(half / max(away, 0.05)) / abs(step)
    return away, max(0, int(np.ceil(middle - reach - 0.5))), min(n - 1, int(middle + reach + 0.5))
