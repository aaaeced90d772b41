"""Two feet side by side that came together, where nothing stood and nobody is: somebody, though nobody saw him walk."""

from __future__ import annotations

from typing import Any

from numba import njit

from tms_agents.floor.norm import norm

#: Who stands has his feet so far apart (m), put down within this (s), both seen so lately (s), in so many scans, and in
#: this share of all; two together are no wider (m) for anybody.
_APART_M, _TOGETHER_S, _SEEN_S, _SCANS, _BOTH, _WIDE_M = (0.1, 0.4), 1.25, 0.3, 15, 0.5, 0.35


@njit(cache=True)
def is_pair(body: Any, t: float) -> bool:
    """Whether a body not yet believed is such a pair, of people's size."""
    if body.robot or body.far > _WIDE_M or body.from_furniture or body.a_print < 0 or body.a_print == body.b_print:
        return False
    apart = norm(body.ax - body.bx, body.ay - body.by)
    near = _APART_M[0] < apart < _APART_M[1] and max(t - body.a_seen, t - body.b_seen) < _SEEN_S
    together = abs(body.a_land - body.b_land) < _TOGETHER_S
    return bool(near and together and body.both > max(_SCANS, _BOTH * body.hits))
