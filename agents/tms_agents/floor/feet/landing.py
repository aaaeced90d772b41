"""How likely a shoe is to land here and now: where its owner is, how long it was up, how long the other one stands.

A conditional logit model: of all who may have put down a shoe that has just appeared, which did? Its numbers are
fitted to 12,800 shoes that land within 1.3 m of somebody else (simulated people, an assignment of all feet that is
right); of those it had not seen 89 % go to their owner, by the distance from where the body should be alone 85 %.
(`benchmarks/floor_feet.py` fits such numbers again: they tell single landings better and lose names more often.)
Every density is normed: who is known less well is expected in more places, and less at each.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.norm import norm

Array = NDArray[np.float64]

#: Log likelihood by how long (s) the shoe was not seen: who is seen standing on it has not put it down elsewhere.
_UP_S = np.array([0.05, 0.12, 0.2, 0.3, 0.38, 0.45, 0.55, 0.65, 0.8, 1.1, 2.0])
_UP = np.array([-0.73, -1.51, -1.24, -1.38, -1.17, 0.95, 1.06, 1.53, 0.85, 0.97, 0.68])
#: The same by how long ago (s) the other one has landed.
_OTHER_S = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0, 1.5, 3.0])
_OTHER = np.array([0.0, 0.81, -0.69, -1.35, -0.59, 0.25, 0.77, 0.52, -0.11, 0.03, 0.54, -0.17])
#: That is fitted up to three seconds. Who has stood for longer than this (s), twice as long, sets off half as often in
#: one scan, and so on: so it is where some stand for seconds and some for minutes. Sooner whoever only pauses between
#: two ways loses his step to a passer. Longer than the second (s) is never: no other one has landed.
_LONG_S, _NEVER_S = 10.0, 1e6
#: It lands so far (m) ahead of the body, farther ahead by so much per m/s and per m that the other one is behind.
_AHEAD_M, _PER_SPEED, _PER_LAG = -0.02, 0.26, 0.27
#: Who goes on as he went: standard deviation (m) along and aside, and how much what is not known of the body counts.
_ALONG_M, _ALONG_MORE, _ASIDE_M, _ASIDE_MORE = 0.081, 1.57, 0.083, 0.82
#: Who turns or stops: logarithm of how much as often, standard deviation (m) around the body, and the same.
_TURNS, _TURNS_M, _TURNS_MORE = 0.22, 0.394, 3.0
#: The step from the other foot: standard deviation (m) of its length, and the same; of its width (m); what any step is
#: worth; from this speed (m/s) on it counts wholly.
_STEP_M, _STEP_MORE, _WIDTH_M, _ANY_STEP, _STEPS = 0.405, 1.41, 1.6, -2.46, 0.35
#: Who goes slower than this (m/s) has no heading.
_GOES = 0.05
#: As the other costs of an assignment count it, a landing without these terms costs this.
_LEVEL = 6.5


class Way(NamedTuple):
    """What `lands` needs of a body, whichever shoe and cluster it is: worked out once.

    Its speed (m/s) and heading (0, 0: it stands); variances (m²) of where its shoes land, along and aside and around
    it, and of the length of its step; the logarithms of what norms them.
    """

    speed: float
    ux: float
    uy: float
    along: float
    across: float
    around: float
    lengths: float
    log_goes_on: float
    log_around: float
    log_lengths: float


@njit(cache=True)
def way(body: Any) -> Way:
    """Of this body."""
    speed = norm(body.vx, body.vy)
    ux, uy = (body.vx / speed, body.vy / speed) if speed > _GOES else (0.0, 0.0)
    along, across = _ALONG_M**2 + _ALONG_MORE * body.pp, _ASIDE_M**2 + _ASIDE_MORE * body.pp
    around, lengths = _TURNS_M**2 + _TURNS_MORE * body.pp, _STEP_M**2 + _STEP_MORE * body.pp
    logs = np.log(along * across), np.log(around), np.log(lengths * _WIDTH_M**2)
    return Way(speed, ux, uy, along, across, around, lengths, logs[0], logs[1], logs[2])


@njit(cache=True)
def landing(body: Any, c: Any, ox: float, oy: float, seen: float, other: float, since: float) -> float:
    """Negative log likelihood of the cluster c, there ``since`` (s), being a shoe of the body that has landed.

    The shoe was last ``seen`` (s); the ``other`` one, at (ox, oy) m, has landed at that time (s).
    """
    return lands(body, way(body), c, ox, oy, seen, other, since)


@njit(cache=True)
def lands(body: Any, goes: Way, c: Any, ox: float, oy: float, seen: float, other: float, since: float) -> float:
    """As `landing`, of a body whose `way` is known."""
    ago = body.at - since
    x, y = c.x - body.x + ago * body.vx, c.y - body.y + ago * body.vy
    ux, uy = goes.ux, goes.uy
    if ux == 0.0 and uy == 0.0:
        # Who stands may set off any way: the way to this shoe.
        away = max(norm(x, y), 1e-9)
        ux, uy = x / away, y / away
    ahead, aside = x * ux + y * uy, y * ux - x * uy
    step = (c.x - ox) * ux + (c.y - oy) * uy
    off = ahead - _AHEAD_M - _PER_SPEED * goes.speed + _PER_LAG * (ahead - step)
    goes_on = -0.5 * (off * off / goes.along + aside * aside / goes.across + goes.log_goes_on)
    turns = _TURNS - 0.5 * (ahead * ahead + aside * aside) / goes.around - goes.log_around
    length = -0.5 * ((step - body.stride) ** 2 / goes.lengths + goes.log_lengths)
    value = np.logaddexp(goes_on, turns) + np.logaddexp(length, _ANY_STEP) * min(goes.speed / _STEPS, 1.0)
    value += _read(since - seen, _UP_S, _UP) + _read(since - other, _OTHER_S, _OTHER)
    if _LONG_S < since - other < _NEVER_S:
        value -= np.log((since - other) / _LONG_S)
    return float(_LEVEL - value)


@njit(cache=True)
def _read(x: float, knots: Array, values: Array) -> float:
    """The value at x of a function that is straight between its knots, and constant beyond them.

    `numpy.interp` of one number takes nine times as long in a kernel.
    """
    for i in range(1, knots.size):
        if x < knots[i]:
            share = max(x - knots[i - 1], 0.0) / (knots[i] - knots[i - 1])
            return float(values[i - 1] + share * (values[i] - values[i - 1]))
    return float(values[-1])
