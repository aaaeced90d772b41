"""Two things put down at about the same time: the path of the load tells them apart where their sum cannot.

While only the first thing comes down the load moves along its direction, u1 (its shares of the cells); while only the
second one is left it moves along the other's, u2. Where the path turns is found by least squares; then the whole step D
is w1 u1 + w2 u2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tms_agents.cabinet.geometry import Array, Geometry
from tms_agents.cabinet.steps import Step
from tms_agents.cabinet.wandering import misfit, pulls_of

_LEAST_BLOCKS = 4
#: Two changes within less than a block or two are hardly possible.
_NO_PATH = -6.0
#: Scale beyond which a misfit counts less.
_MOST_ODDS = 12.0
#: How far aside a hand presses, as a share of what it presses.
_HAND = 0.03


class Split(NamedTuple):
    """Loads (k,) of the first and the second thing, their variances, and what the path says for two things and not one.

    ``gain`` is a log-likelihood ratio before any prior.
    """

    first: Array
    second: Array
    variance: Array
    gain: float


def split(step: Step, geometry: Geometry) -> Split | None:
    """The step as the sum of two; None where its path is too short to tell."""
    path = step.path
    count, cells = path.shape
    noise = step.path_variance + ((_HAND**2 / cells) * (path**2).sum(axis=1))[:, None]
    if count < _LEAST_BLOCKS:
        return None
    sd = np.sqrt(noise.mean(axis=0))
    weight = np.sqrt((sd**2).mean() / noise.mean(axis=1))[:, None]
    whole = step.change / sd
    so_far, to_go = weight * path / sd, weight * (whole - path / sd)
    early = np.cumsum(so_far[:, :, None] * so_far[:, None, :], axis=0)
    late = np.cumsum((to_go[:, :, None] * to_go[:, None, :])[::-1], axis=0)[::-1]
    early_values, early_vectors = np.linalg.eigh(early)
    late_values, late_vectors = np.linalg.eigh(late)
    # Misfit of the first i + 1 blocks to one direction, of those from j on to another; between them, that of noise.
    misfit_early, misfit_late = early_values[:, :-1].sum(axis=1), late_values[:, :-1].sum(axis=1)
    between = np.arange(count)[None, :] - np.arange(count)[:, None] - 1
    cost = misfit_early[:, None] + misfit_late[None, :] + (cells - 0.5) * between
    i, j = np.unravel_index(np.where(between >= 0, cost, np.inf).argmin(), cost.shape)
    one = whole / np.linalg.norm(whole)
    aside = so_far - (so_far @ one)[:, None] * one
    pulls = weight[:, :, None] * pulls_of(path, geometry) / sd[:, None]
    pulls = pulls - np.einsum("tkb,k->tb", pulls, one)[:, None, :] * one[:, None]
    # As straight as can be, or astray: whichever fits better.
    single = min(float((aside**2).sum()), misfit(aside, pulls))
    directions = np.stack([early_vectors[i, :, -1], late_vectors[j, :, -1]])
    if abs(float(directions[0] @ directions[1])) > 0.999:
        return None
    scale, *_ = np.linalg.lstsq(directions.T, whole, rcond=None)
    left = whole - scale @ directions
    # Errors of the directions, by how far the path went along each of them.
    errors = scale**2 / np.maximum([early_values[i, -1], late_values[j, -1]], 1.0)
    spread = 1.0 / max(1e-3, 1.0 - float(directions[0] @ directions[1]) ** 2)
    variance = sd**2 * float(errors.sum()) * spread + step.variance
    two = float(cost[i, j]) + float((left**2 / (variance / sd**2)).sum())
    first = scale[0] * directions[0] * sd
    off = scale[0] * (directions[0] - one * float(one @ directions[0]))
    return Split(first, step.change - first, variance, _dampened(0.5 * (single - two)) - _freedom(off, count))


def path_odds(step: Step, one: Array, geometry: Geometry, *, same_thing: bool = False) -> float:
    """Log-likelihood ratio that the load went by two changes, ``one`` (k,) and the rest of the step, instead of by one.

    A single change goes straight. Two changes at once leave the straight line, unless they keep exactly the same time.
    ``same_thing``: it is slid, which also goes straight unless it is pressed meanwhile.
    """
    count = len(step.path)
    if count < 2:
        return _NO_PATH
    sd = np.sqrt(step.path_variance.mean(axis=0))
    straight = step.change / sd
    straight = straight / max(float(np.linalg.norm(straight)), 1e-9)
    off = one / sd - straight * float(straight @ (one / sd))
    size = float(np.linalg.norm(off))
    if size < 1.0:
        return 0.0
    path = step.path / sd
    aside = path @ (off / size)
    # A hand does not press exactly on the centre of the thing that it moves.
    unit = 1.0 + (_HAND * np.linalg.norm(path, axis=1)) ** 2
    pulls = np.einsum("tkb,k->tb", pulls_of(step.path, geometry) / sd[:, None], off / size)
    root = np.sqrt(unit)
    stray = misfit((aside / root)[:, None], (pulls / root[:, None])[:, None, :])
    gain = 0.5 * (min(float((aside**2 / unit).sum()), stray) - count)
    return _dampened(gain) if same_thing else _dampened(gain) - _freedom(off / math.sqrt(float(unit.mean())), count)


def _dampened(gain: float) -> float:
    """Large misfits have other reasons than noise: they count, but less and less."""
    return _MOST_ODDS * math.log1p(gain / _MOST_ODDS) if gain > 0 else gain


def _freedom(off: Array, count: int) -> float:
    """Price of a path that may leave the straight line as it likes: three times the log of how far, in noise."""
    return 1.5 * math.log(1.0 + count / 3.0 * 0.1 * float(off @ off))
