"""How probably an antenna reads a tag: a lobe, no range and no bearing (Haehnel, Burgard, Fox et al. 2004).

The range at which a tag is read falls with the square root of the power that reaches it: with the bearing seen from
the antenna, with how far the tag is turned away, and not sharply. A little is read everywhere (reflections).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from tms_agents.slam.geometry import Floats
from tms_agents.slam.semidynamic.models import Antenna

#: Reads inside the lobe, and outside; how blurred its edge is (share of the range).
_INSIDE, _OUTSIDE, _EDGE = 0.7, 0.004, 0.15
#: A tag that is turned away is read at most at this share of the range.
_BEHIND = 0.12
#: Reads from about the same place are no independent witnesses.
_TEMPER = 0.25
#: Of a product of probabilities the logarithm is taken before it gets smaller.
_SMALL = 1e-200


def detection(antenna: Antenna, tags: Floats) -> Floats:
    """Probability (...,) that one round reads tags at ``tags`` (..., 3), seen from the antenna."""
    flat = np.ascontiguousarray(tags, dtype=np.float64).reshape(-1, 3)
    found = np.empty(len(flat))
    _detection(flat, antenna.reach, _exponent(antenna), found)
    return found.reshape(tags.shape[:-1])


def read_odds(antenna: Antenna, seen_from: Floats, tags: Floats, *, read: bool) -> Floats:
    """Log-likelihood (N,), tempered, that every round from antenna poses ``seen_from`` (R, 3) did ``read`` tags at
    ``tags`` (N, 3), or that none did."""
    total = np.empty(len(tags))
    _odds(seen_from, tags, antenna.reach, _exponent(antenna), read, total)
    return _TEMPER * total


def _exponent(antenna: Antenna) -> float:
    """Of the lobe's cosine: half the power at the half beam."""
    return float(np.log(0.5) / np.log(max(np.cos(min(antenna.half_beam, 1.5)), 1e-3)))


@njit(cache=True)
def _probability(distance: float, ahead: float, facing: float, reach: float, exponent: float) -> float:
    """At a ``distance`` (m), from the cosines of the bearing and of how far the tag is turned away."""
    # Half the power at 60 degrees is a cosine, and three eighths of a power are three roots: all this is done
    # millions of times.
    lobe = np.sqrt(max(ahead, 1e-3)) if abs(exponent - 1.0) < 1e-6 else max(ahead, 1e-3) ** (0.5 * exponent)
    fourth = np.sqrt(np.sqrt(max(facing, 0.0)))
    lobe *= max(fourth * np.sqrt(fourth), _BEHIND)
    inside = 1.0 / (1.0 + np.exp((distance - 1.05 * reach * lobe) / (_EDGE * reach)))
    found: float = _OUTSIDE + (_INSIDE - _OUTSIDE) * inside
    return found


@njit(cache=True)
def _detection(tags: Floats, reach: float, exponent: float, found: Floats) -> None:
    for n in range(len(tags)):
        x, y = tags[n, 0], tags[n, 1]
        distance = max(np.hypot(x, y), 1e-9)
        facing = -(np.cos(tags[n, 2]) * x + np.sin(tags[n, 2]) * y) / distance
        found[n] = _probability(distance, x / distance, facing, reach, exponent)


@njit(cache=True)
def _odds(seen_from: Floats, tags: Floats, reach: float, exponent: float, read: bool, total: Floats) -> None:
    beams = np.stack((np.cos(seen_from[:, 2]), np.sin(seen_from[:, 2])), axis=-1)
    for n in range(len(tags)):
        total[n], product = 0.0, 1.0
        cosine, sine = np.cos(tags[n, 2]), np.sin(tags[n, 2])
        for r in range(len(seen_from)):
            x, y = tags[n, 0] - seen_from[r, 0], tags[n, 1] - seen_from[r, 1]
            distance = max(np.sqrt(x * x + y * y), 1e-9)
            ahead = (beams[r, 0] * x + beams[r, 1] * y) / distance
            p = _probability(distance, ahead, -(cosine * x + sine * y) / distance, reach, exponent)
            product *= p if read else 1.0 - p
            if product < _SMALL:
                total[n] += np.log(product)
                product = 1.0
        total[n] += np.log(product)
