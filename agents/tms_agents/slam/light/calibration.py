"""What the laser makes of distance and angle: a table of log intensity, learnt from the log that is to be mapped.

Intensity says more of range and incidence than of the surface (falling with distance, with cos of the incidence, bent
by the amplifier). Nothing of that is assumed: a piecewise bilinear table over (log range, incidence) is fitted to the
log intensities of all beams, by least absolute deviations, so that at each knot about half of what was seen is
brighter. What remains after it is the surface. A second table holds how much neighbouring beams scatter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from tms_agents.slam.geometry import Floats

_RANGES, _INCIDENCES = 12, 12
STEEPEST = np.radians(80.0)
#: At most so many beams are fitted; how strongly the table is held smooth (in beams); rounds of reweighting.
_MOST, _SMOOTH, _ROUNDS = 60_000, 1000.0, 12
#: Deviation / median absolute deviation of a normal distribution; nothing is better known than this (log).
_MAD, _LEAST_NOISE = 1.4826, 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """``table`` and ``noise`` (12, 12) of log intensity over log range, from ``nearest`` to ``farthest`` (log m), and
    incidence 0 .. `STEEPEST`."""

    nearest: float
    farthest: float
    table: Floats
    noise: Floats

    def normalised(self, ranges: Floats, incidence: Floats, intensities: Floats) -> tuple[Floats, Floats]:
        """(light, deviation) (M,): log intensity less the table, and its noise; NaN where there is no intensity, no
        surface, or it is met too obliquely."""
        usable = (intensities > 0.0) & (incidence < STEEPEST)
        light, deviation = np.full(len(ranges), np.nan), np.full(len(ranges), np.nan)
        basis = _basis(np.log(ranges[usable]), incidence[usable], self.nearest, self.farthest)
        light[usable] = np.log(intensities[usable]) - basis @ self.table.ravel()
        deviation[usable] = basis @ self.noise.ravel()
        return light, deviation


def learn(ranges: Floats, incidence: Floats, intensities: Floats) -> Calibration:
    """From beams (M,) in the order in which they were taken, NaN incidence where there is no surface.

    Raises:
        ValueError: too few beams with light.
    """
    usable = np.flatnonzero((intensities > 0.0) & (incidence < STEEPEST) & (ranges > 0.0))
    if len(usable) < 100:
        raise ValueError(f"only {len(usable)} beams met a surface and brought light back")
    log_range, logs = np.log(ranges), np.log(np.where(intensities > 0.0, intensities, 1.0))
    nearest, farthest = (float(q) for q in np.quantile(log_range[usable], [0.002, 0.998]))
    farthest = max(farthest, nearest + 0.1)
    chosen = usable[:: max(1, len(usable) // _MOST)]
    table = _fitted(_basis(log_range[chosen], incidence[chosen], nearest, farthest), logs[chosen])
    # Neighbours are on the same colour, mostly: half of the differences are noise alone.
    pairs = usable[:-1][np.diff(usable) == 1]
    pairs = pairs[:: max(1, len(pairs) // _MOST)]
    basis = _basis(log_range[pairs], incidence[pairs], nearest, farthest)
    apart = np.abs(
        (logs[pairs + 1] - logs[pairs]) - (_differences(log_range, incidence, pairs, nearest, farthest) @ table)
    )
    noise = _MAD / np.sqrt(2.0) * _fitted(basis, apart)
    shape = (_RANGES, _INCIDENCES)
    return Calibration(nearest, farthest, table.reshape(shape), np.maximum(noise, _LEAST_NOISE).reshape(shape))


def _differences(
    log_range: Floats, incidence: Floats, pairs: Floats, nearest: float, farthest: float
) -> sparse.csr_array:
    after = _basis(log_range[pairs + 1], incidence[pairs + 1], nearest, farthest)
    return after - _basis(log_range[pairs], incidence[pairs], nearest, farthest)


def _basis(log_range: Floats, incidence: Floats, nearest: float, farthest: float) -> sparse.csr_array:
    """(M, 144) weights of the four knots around each beam; beyond the table its edge holds."""
    rows = (log_range - nearest) / (farthest - nearest) * (_RANGES - 1)
    columns = incidence / STEEPEST * (_INCIDENCES - 1)
    i, u = _cell(rows, _RANGES)
    j, v = _cell(columns, _INCIDENCES)
    knots = np.stack(
        [i * _INCIDENCES + j, (i + 1) * _INCIDENCES + j, i * _INCIDENCES + j + 1, (i + 1) * _INCIDENCES + j + 1]
    )
    weights = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v])
    beams = np.broadcast_to(np.arange(len(log_range)), knots.shape)
    return sparse.csr_array(
        (weights.ravel(), (beams.ravel(), knots.ravel())), shape=(len(log_range), _RANGES * _INCIDENCES)
    )


def _cell(places: Floats, knots: int) -> tuple[Floats, Floats]:
    inside = np.clip(places, 0.0, knots - 1.0)
    first = np.minimum(inside.astype(np.int64), knots - 2)
    return first, inside - first


def _fitted(basis: sparse.csr_array, values: Floats) -> Floats:
    """(144,) knots of least absolute deviation, by reweighting, held smooth where beams are few."""
    bend = _bending()
    middle = float(np.median(values))
    knots: Floats = np.full(basis.shape[1], middle)
    scale = max(1e-3, float(np.median(np.abs(values - middle))))
    for _ in range(_ROUNDS):
        weights = 1.0 / np.sqrt(np.square((values - basis @ knots) / scale) + 0.01)
        weighted = basis.T @ sparse.diags_array(weights)
        matrix = (weighted @ basis + _SMOOTH * bend).tocsc()
        knots = middle + spsolve(matrix, weighted @ (values - middle))
    return knots


def _bending() -> sparse.csr_array:
    """Squared second differences along both axes, and a little of the first ones, which keep empty corners flat."""
    parts = []
    for size, other, left in ((_RANGES, _INCIDENCES, True), (_INCIDENCES, _RANGES, False)):
        second = sparse.diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(size - 2, size))
        first = sparse.diags_array([-0.01, 0.01], offsets=[0, 1], shape=(size - 1, size))
        both = sparse.vstack([second, first])
        one = sparse.eye_array(other)
        parts.append(sparse.kron(both, one) if left else sparse.kron(one, both))
    stacked = sparse.vstack(parts)
    return (stacked.T @ stacked).tocsr()
