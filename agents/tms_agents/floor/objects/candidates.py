"""Who may have put something down or taken it away: by how near each came."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from tms_agents.floor.events import Candidates

#: How near who acts is (m, Gaussian), and who is too far to have acted.
_ARM_M, FAR_M = 0.5, 1.6


def near_movers(bodies: Any, print_: Any) -> dict[int, float]:
    """How far (m) each of ``bodies`` (n,) is that could reach the print, by its label."""
    present = (bodies["used"] == 1) & (bodies["confirmed"] == 1)
    away = np.hypot(bodies["x"] - print_["x"], bodies["y"] - print_["y"])
    return {int(bodies["label"][b]): float(away[b]) for b in np.flatnonzero(present & (away < FAR_M)).tolist()}


def candidates(visitors: Mapping[int, float]) -> Candidates:
    """Who acted, by how near (m) each came; the remainder is that it was nobody known."""
    weights = {mover: math.exp(-(near**2) / (2 * _ARM_M**2)) for mover, near in visitors.items()}
    total = sum(weights.values()) + 0.02
    return tuple(sorted(((mover, w / total) for mover, w in weights.items()), key=lambda item: (-item[1], item[0])))
