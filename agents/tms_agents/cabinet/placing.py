"""Where a thing stands, from all of the way on which its load came, not only from its end.

While a hand puts a thing down its force is unknown, but it acts where the thing is going to stand, apart from a tilt:
first the thing touches with an edge, and the point of contact wanders by a centimetre until the hand has let go. When
that was is unknown too. For each possible end the place follows by weighted least squares, with the tilt as a parameter
of known spread; the results are averaged by how well force and moments fit (the force is constant after the end).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.cabinet.geometry import Array, Geometry

#: Standard deviation of where a thing touches first against where it stands in the end, m.
_TILT_M = 0.01
#: Probability that the hand has not let go of a load that seems steady, and how long it still may take, in shares of
#: the time since the first touch.
_HELD, _LATER = 0.3, np.array([0.03, 0.08, 0.15, 0.25, 0.4])
#: A hand presses by this share and so many grams, and changes that slowly: neighbouring blocks say partly the same.
_PRESSED, _PRESSED_G, _SLOWLY = 0.1, 5.0, 0.5
#: Ends are sought among so many blocks.
_ENDS = 24


@dataclass(frozen=True, slots=True)
class Way:
    """Block means (n, k) g above the old level, and their variances, from the first touch (``onset``, s) on.

    ``times`` (n,) are the middles of the blocks; those from ``tail`` on seem steady. ``before`` (k,) is the variance of
    the old level, an error that all blocks share; ``now`` the end of the last one.
    """

    onset: float
    now: float
    times: Array
    means: Array
    variances: Array
    tail: int
    before: Array


@dataclass(frozen=True, slots=True)
class Placed:
    """``xy`` with the variance (m^2) of each, and the same as if the load had surely been steady at the end.

    ``tail`` is the first block of ``Way`` after the most probable end.
    """

    xy: tuple[float, float]
    variance: tuple[float, float]
    at_rest: tuple[float, float]
    tail: int
    ended: float
    held: float


def place(way: Way, geometry: Geometry) -> Placed | None:
    """The place of the one thing that came on this ``way``; None if that is too short to tell."""
    n = len(way.times)
    if n < 4:
        return None
    first = min(max(way.tail - 3, 1), n - 2)
    ends = np.unique(np.linspace(first, n - 2, min(_ENDS, n - 1 - first)).astype(int)) if n - 2 > first else [first]
    last = np.full(len(_LATER), max(n - 4, min(way.tail, n - 2)))
    tails = np.concatenate([ends, last]).astype(int)
    half = 0.5 * (way.times[1:] - way.times[:-1])
    past = way.times[ends] - half[np.asarray(ends) - 1]
    until = np.concatenate([past, way.now + _LATER * max(way.now - way.onset, 0.2)])
    prior = np.concatenate([np.full(len(ends), (1 - _HELD) / len(ends)), np.full(len(_LATER), _HELD / len(_LATER))])
    xy, variance, score = _fits(way, geometry, tails, until)
    score = score + np.log(prior)
    share = np.exp(score - score.max())
    share /= share.sum()
    ended = share[: len(ends)]
    best = int(np.argmax(ended))
    mean = share @ xy
    spread = share @ (variance + (xy - mean) ** 2)
    total = float(ended.sum())
    at_rest = spread
    if total > 1e-6:
        middle = ended @ xy[: len(ends)] / total
        at_rest = ended @ (variance[: len(ends)] + (xy[: len(ends)] - middle) ** 2) / total
    return Placed(
        (float(mean[0]), float(mean[1])),
        (float(spread[0]), float(spread[1])),
        (float(at_rest[0]), float(at_rest[1])),
        int(ends[best]),
        float(until[best]),
        1.0 - total,
    )


def refine(way: Way, tail: int, load: Array, variance: Array, geometry: Geometry) -> tuple[Array, Array]:
    """Place (2,) and its variance (2,), once the ``load`` (k,) g after the way's ``tail`` is known for itself."""
    whole = Way(
        way.onset,
        way.now,
        np.append(way.times[:tail], way.now),
        np.vstack([way.means[:tail], load]),
        np.vstack([way.variances[:tail], variance]),
        tail,
        way.before,
    )
    until = way.times[tail] if tail < len(way.times) else way.now
    xy, spread, _ = _fits(whole, geometry, np.array([tail]), np.array([until]))
    return xy[0], spread[0]


def _fits(way: Way, geometry: Geometry, tails: Array, until: Array) -> tuple[Array, Array, Array]:
    """For each possible end (c,): place (c, 2), its variance (c, 2), log-likelihood (c,)."""
    moments, noise = way.means @ geometry.moments.T, way.variances.sum(axis=1)
    force, n = moments[:, 0], len(way.times)
    after: NDArray[np.bool_] = np.arange(n) >= np.asarray(tails)[:, None]
    worth = after / noise
    weight = (worth @ force / worth.sum(axis=1))[:, None]
    # A block's own force would be correlated with its moments: take that of its neighbours as what the moments count.
    around = np.concatenate([[0.0], force, force[-1:]])
    neighbours = np.maximum(0.5 * (around[:-2] + around[2:]), 0.0)
    counts, force_then = np.where(after, weight, neighbours), np.where(after, weight, force)
    tilted = np.clip((until[:, None] - way.times) / np.maximum(until - way.onset, 0.08)[:, None], 0.0, 1.0)
    score = _constant(force, weight, noise, after, worth)
    last = slice(min(way.tail, n - 1), None)
    middle = ((1 / noise[last]) @ moments[last]) / (1 / noise[last]).sum()
    places, variances = [], []
    for axis in (0, 1):
        guess = middle[1 + axis] / middle[0] if abs(middle[0]) > 1e-6 else 0.0
        guess = min(max(guess, 0.0), (geometry.width, geometry.depth)[axis])
        lever = (geometry.moments[1 + axis] - guess) ** 2
        own, shared = way.variances @ lever, float(way.before @ lever)
        common = 1.0 / (1.0 / max(shared, 1e-12) + (1 / own).sum())
        rest = moments[:, 1 + axis] - force * guess

        def product(a: Array, b: Array, own: Array = own, common: float = common) -> Array:
            """a' R^-1 b for errors R of each block and of the level that they share."""
            direct = (a / own * b).sum(axis=-1)
            return np.asarray(direct - common * (a / own).sum(axis=-1) * (b / own).sum(axis=-1))

        bent, bent_then = counts * tilted, force_then * tilted
        p = 1 / _TILT_M**2
        a11, a12 = product(counts, force_then), product(counts, bent_then)
        a21, a22 = product(bent, force_then), product(bent, bent_then) + p
        b11, b12, b22 = product(counts, counts), product(counts, bent), product(bent, bent) + p
        determinant = a11 * a22 - a12 * a21
        y1, y2 = product(counts, rest), product(bent, rest)
        offset, tilt = (a22 * y1 - a12 * y2) / determinant, (a11 * y2 - a21 * y1) / determinant
        left = rest - force_then * offset[:, None] - bent_then * tilt[:, None]
        score = score - 0.5 * (product(left, left) + p * tilt**2 + np.log(np.abs(b11 * b22 - b12**2) / p))
        places.append(guess + offset)
        variances.append((a22**2 * b11 - 2 * a22 * a12 * b12 + a12**2 * b22) / determinant**2)
    return np.column_stack(places), np.column_stack(variances), score


def _constant(force: Array, weight: Array, noise: Array, after: NDArray[np.bool_], worth: Array) -> Array:
    """Log-likelihood of a force that is constant ``after`` the end and anything near that before, (c,)."""
    free = noise + (_PRESSED * weight) ** 2 + _PRESSED_G**2
    square = (force - weight) ** 2
    before = -0.5 * (square / free + _SLOWLY * np.log(free / noise))
    score = np.where(after, -0.5 * square / noise, before)
    first = int(np.argmax(after.any(axis=0)))
    # Blocks before all possible ends say the same about each.
    result = score[:, first:].sum(axis=1) - 0.5 * np.log(worth.sum(axis=1))
    return np.asarray(result, dtype=float)
