"""Where somebody is told to be: of who shows shoes, by the feet themselves, not by the filter that follows them.

A filter that moves steadily is late whenever somebody starts, turns or goes faster, and a shoe is seen only while it
stands: for half a second nothing new is known. That it is late does no harm to those who choose whose foot is whose
(`landing` was fitted to it), but a label half a metre behind its owner is of no use. Here the place is a regression on
what is known of the feet, by which of them are seen and how long ago the later one has landed
(`make bench-places` fits the numbers).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.build import SHOES
from tms_agents.floor.norm import norm

Array = NDArray[np.float64]

#: Both feet stand, the one that landed later alone, the other one alone, none is seen.
BOTH, LATER, EARLIER, NONE = 0, 1, 2, 3
#: What is added to the place of the filter. For each case, so much of each of four vectors: the step between the feet,
#: the velocity (times 1 s), the way to the foot that landed later, and the last stride of that foot. The first number
#: holds when that foot has just landed, the second so long (s) after; between them they change linearly.
LONG_S = 0.9
TERMS = np.array(
    [
        [[-0.124, -0.440], [-0.053, 0.465], [0.916, 0.969], [-0.081, -0.066]],
        [[-0.070, 0.043], [-0.063, 0.360], [0.829, 0.909], [-0.060, -0.128]],
        [[-0.894, -0.479], [0.256, 0.139], [1.437, 0.603], [-0.229, -0.097]],
        [[0.096, 0.003], [-0.156, 0.055], [0.482, 0.188], [0.086, -0.082]],
    ]
)
#: The variance (m²) of the place told, by case, at such ages (s).
AGES_S = np.array([0.0, 0.3, 0.6, 0.9])
VARIANCES = np.array(
    [
        [0.007, 0.011, 0.005, 0.003],
        [0.012, 0.018, 0.037, 0.025],
        [0.015, 0.020, 0.039, 0.026],
        [0.052, 0.051, 0.062, 0.096],
    ]
)
#: Who shows legs: two feet tell of the middle of a body by about 5 cm, however long they stand.
_LEGS_VAR = 0.05**2
#: No step and no stride is so long (m), and no foot so far away (m); what was seen so lately (s) is seen now: several
#: lasers scan in turns.
_STEP_M, _STRIDE_M, _AWAY_M, _NOW_S = 1.2, 1.8, 1.0, 0.08


@njit(cache=True)
def place(body: Any, t: float) -> tuple[float, float, float]:
    """(x m, y m, variance m²) of the body at t."""
    if body.shoe < SHOES or body.robot or body.stale:
        return body.x, body.y, body.pp + _LEGS_VAR
    case, age, terms = known(body, t)
    share = min(age / LONG_S, 1.0)
    x, y = body.x, body.y
    for k in range(TERMS.shape[1]):
        weight = (1.0 - share) * TERMS[case, k, 0] + share * TERMS[case, k, 1]
        x += weight * terms[k, 0]
        y += weight * terms[k, 1]
    return x, y, np.interp(age, AGES_S, VARIANCES[case])


@njit(cache=True)
def tell(bodies: Any, index: int, t: float) -> tuple[int, float, float, float]:
    """(label, x m, y m, variance m²) of the mover ``index``, and remember that it is told at t."""
    body = bodies[index]
    body.told_x, body.told_y = body.x, body.y
    x, y, variance = place(body, t)
    return body.label, x, y, variance


@njit(cache=True)
def known(body: Any, t: float) -> tuple[int, float, Array]:
    """(case, age s, terms (4, 2) m) of who shows shoes: of `TERMS`, that they are multiplied by."""
    if body.a_land >= body.b_land:
        qx, qy, px, py, ox, oy = body.a_px, body.a_py, body.b_px, body.b_py, body.a_ox, body.a_oy
        land, stood, other = body.a_land, body.a_stood, body.b_stood
    else:
        qx, qy, px, py, ox, oy = body.b_px, body.b_py, body.a_px, body.a_py, body.b_ox, body.b_oy
        land, stood, other = body.b_land, body.b_stood, body.a_stood
    one, two = t - stood < _NOW_S, t - other < _NOW_S
    case = BOTH if one and two else LATER if one else EARLIER if two else NONE
    terms = np.zeros((4, 2))
    if norm(qx - px, qy - py) < _STEP_M:
        terms[0, 0], terms[0, 1] = qx - px, qy - py
    terms[1, 0], terms[1, 1] = body.vx, body.vy
    terms[2, 0] = min(max(qx - body.x, -_AWAY_M), _AWAY_M)
    terms[2, 1] = min(max(qy - body.y, -_AWAY_M), _AWAY_M)
    if norm(qx - ox, qy - oy) < _STRIDE_M:
        terms[3, 0], terms[3, 1] = qx - ox, qy - oy
    return case, max(t - land, 0.0), terms
