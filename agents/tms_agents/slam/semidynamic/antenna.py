"""How probably an antenna reads a tag: a lobe, no range and no bearing (Haehnel, Burgard, Fox et al. 2004).

The range at which a tag is read falls with the square root of the power that reaches it: with the bearing seen from
the antenna, with how far the tag is turned away, and not sharply. A little is read everywhere (reflections).
"""

from __future__ import annotations

import numpy as np

from tms_agents.slam.geometry import Floats, between
from tms_agents.slam.semidynamic.models import Antenna

#: Reads inside the lobe, and outside; how blurred its edge is (share of the range).
_INSIDE, _OUTSIDE, _EDGE = 0.7, 0.004, 0.15
#: A tag that is turned away is read at most at this share of the range.
_BEHIND = 0.12
#: Reads from about the same place are no independent witnesses.
_TEMPER = 0.25


def detection(antenna: Antenna, tags: Floats) -> Floats:
    """Probability (...,) that one round reads tags at ``tags`` (..., 3), seen from the antenna."""
    distance = np.hypot(tags[..., 0], tags[..., 1])
    bearing = np.arctan2(tags[..., 1], tags[..., 0])
    facing = np.arctan2(-tags[..., 1], -tags[..., 0]) - tags[..., 2]
    # Half the power at the half beam: cos(bearing) ** n with cos(half beam) ** n = 1/2.
    exponent = np.log(0.5) / np.log(max(np.cos(min(antenna.half_beam, 1.5)), 1e-3))
    ahead = np.maximum(np.cos(bearing), 1e-3) ** exponent
    turned = np.maximum(np.cos(facing), 0.0)
    reach = antenna.reach * np.sqrt(ahead) * np.maximum(turned**0.35, _BEHIND)
    inside = 1.0 / (1.0 + np.exp((distance - 1.05 * reach) / (_EDGE * antenna.reach)))
    found: Floats = _OUTSIDE + (_INSIDE - _OUTSIDE) * inside
    return found


def read_odds(antenna: Antenna, seen_from: Floats, tags: Floats, *, read: bool) -> Floats:
    """Log-likelihood (N,), tempered, that every round from antenna poses ``seen_from`` (R, 3) did ``read`` tags at
    ``tags`` (N, 3), or that none did."""
    p = detection(antenna, between(seen_from[:, None, :], tags[None, :, :]))
    total: Floats = _TEMPER * (np.log(p) if read else np.log1p(-p)).sum(axis=0)
    return total
