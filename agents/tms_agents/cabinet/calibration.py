"""What the counts of a board mean: gain and offset of every cell (and where the cells are) from known weights.

For a weight ``W`` at ``p`` the calibrated loads ``w_i = gain_i (count_i - offset_i)`` of the cells at ``x_i`` obey

    sum w_i = W          sum w_i x_i = W p

Both are linear in the gains, so a few spots give them by least squares. With unknown positions ``a_i = gain_i x_i``
takes the place of the second line; that needs spots whose loads the cells share in enough different ways.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Beyond this a gain is known ten times worse than it could be, or not at all.
_MAX_CONDITION = 200.0
#: A cell whose counts never leave their noise by this factor does not feel the weight.
_RESPONSE = 6.0
#: Cells of one board are of one kind: gains that differ by more than this factor are a fault.
_MAX_GAIN_RATIO = 5.0
#: The spots must span this share of the board across their main direction.
_MIN_SPREAD = 0.1


class CalibrationError(ValueError):
    """The measurements cannot give a calibration; the text says what to change."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Mean counts of every cell (shape (k,)) with a weight of ``weight_g`` grams at ``xy`` (metres, board frame)."""

    weight_g: float
    xy: tuple[float, float]
    counts: Floats


@dataclass(frozen=True, slots=True)
class Residual:
    """Of one spot: calibrated minus true weight (g), and calibrated minus true position (m)."""

    weight_g: float
    xy: tuple[float, float]
    error_g: float
    error_m: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Solution:
    """``gain`` in g per count and ``offset`` in counts, shape (k,); ``cells`` in metres, shape (k, 2).

    ``gain_sd`` is what noise and placing by hand make of the gains' accuracy (g per count, as ``gain``), ``noise_g``
    the noise of one sample of each cell. ``condition`` tells how well the spots determine the gains: 1 is best.
    """

    gain: Floats
    offset: Floats
    cells: Floats
    gain_sd: Floats
    noise_g: Floats
    condition: float
    residuals: tuple[Residual, ...]

    def grams(self, counts: Floats) -> Floats:
        return (np.asarray(counts) - self.offset) * self.gain

    @property
    def rmse_weight_g(self) -> float:
        return float(np.sqrt(np.mean([one.error_g**2 for one in self.residuals])))

    @property
    def rmse_position_m(self) -> float:
        """Root mean square distance between where the weight was and where the board saw it."""
        return float(np.sqrt(np.mean([one.error_m[0] ** 2 + one.error_m[1] ** 2 for one in self.residuals])))


def solve(
    empty: Floats,
    noise: Floats,
    measured: Sequence[Measured],
    cells: Floats | None,
    *,
    samples: int = 1,
    spot_sd_m: float = 0.003,
) -> Solution:
    """Least squares for gains, and positions where ``cells`` is None.

    ``empty`` and ``noise``: mean and standard deviation of the counts of the empty board, shape (k,). ``measured``:
    means over ``samples`` samples each. ``cells``: positions in metres, shape (k, 2). ``spot_sd_m``: how exactly the
    weight was put on its spot; it sets what the moments count beside the totals.

    Raises:
        CalibrationError: too few or collinear spots, a cell that does not respond, gains that no board has.
    """
    empty, noise = np.asarray(empty, dtype=float), np.asarray(noise, dtype=float)
    weights = np.array([one.weight_g for one in measured])
    spots = np.array([one.xy for one in measured], dtype=float).reshape(-1, 2)
    differences = np.array([one.counts for one in measured], dtype=float).reshape(-1, len(empty)) - empty
    _check_weights(weights)
    _check_responses(differences, noise, samples)
    _check_spots(spots, cells, len(empty))
    noise_of_mean = noise / np.sqrt(samples)
    if cells is None:
        gain, at, gain_sd, condition = _fit_with_positions(differences, weights, spots, noise_of_mean)
    else:
        at = np.asarray(cells, dtype=float)
        gain, gain_sd, condition = _fit(differences, weights, spots, at, noise_of_mean, spot_sd_m)
    _check_gains(gain)
    loads = differences * gain
    totals = loads.sum(axis=1)
    seen = loads @ at / totals[:, None]
    residuals = tuple(
        Residual(float(w), (float(p[0]), float(p[1])), float(t - w), (float(s[0] - p[0]), float(s[1] - p[1])))
        for w, p, t, s in zip(weights, spots, totals, seen, strict=True)
    )
    return Solution(gain, empty, at, gain_sd, noise * np.abs(gain), condition, residuals)


def _fit(
    differences: Floats, weights: Floats, spots: Floats, cells: Floats, noise: Floats, spot_sd_m: float
) -> tuple[Floats, Floats, float]:
    """Positions known: totals and moments together, each equation weighted by its accuracy."""
    k = differences.shape[1]
    if k == 1:  # a single cell sees no moments
        spots = np.broadcast_to(cells, spots.shape)
    centre = cells.mean(axis=0)
    arms, aims = cells - centre, spots - centre
    rows = np.concatenate([differences, differences * arms[:, 0], differences * arms[:, 1]])
    right = np.concatenate([weights, weights * aims[:, 0], weights * aims[:, 1]])
    gain: Floats = np.full(k, 1.0)
    reach = max(float(np.ptp(arms, axis=0).max()) / 2, 1e-3)
    sd = np.concatenate([np.ones(len(weights)), np.full(2 * len(weights), reach)])
    for _ in range(3):  # the accuracy of an equation in grams depends on the gains, weakly
        gain = np.asarray(np.linalg.lstsq(rows / sd[:, None], right / sd, rcond=None)[0])
        cell_sd = np.maximum(noise * np.abs(gain), 1e-9)
        total = np.full(len(weights), np.sqrt((cell_sd**2).sum()) + 1e-6 * weights.max())
        moments = [np.hypot(np.sqrt(((cell_sd * arms[:, axis]) ** 2).sum()), weights * spot_sd_m) for axis in (0, 1)]
        sd = np.concatenate([total, *(moment + 1e-6 * weights.max() * reach for moment in moments)])
    # How well the spots determine the gains is a matter of geometry alone: judged with equations of equal accuracy.
    equal = np.concatenate([np.ones(len(weights)), np.full(2 * len(weights), reach)])
    condition = _condition(rows * gain / equal[:, None])
    return np.asarray(gain), _sd(rows / sd[:, None]), condition


def _fit_with_positions(
    differences: Floats, weights: Floats, spots: Floats, noise: Floats
) -> tuple[Floats, Floats, Floats, float]:
    """Positions unknown: the totals give the gains, the moments gain times position."""
    condition = _condition(differences / np.abs(differences).max(axis=0))
    right = np.column_stack([weights, weights[:, None] * spots])
    unknown = np.asarray(np.linalg.lstsq(differences, right, rcond=None)[0], dtype=np.float64)
    gain = unknown[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        at = np.asarray(unknown[:, 1:] / gain[:, None])
    sd = max(float(np.sqrt(((noise * gain) ** 2).sum())), 1e-9)
    return gain, at, _sd(differences / sd), condition


def _condition(rows: Floats) -> float:
    """Raises CalibrationError where the equations do not determine the unknowns."""
    values = np.linalg.svd(rows, compute_uv=False)
    condition = float(values[0] / values[-1]) if len(rows) >= rows.shape[1] and values[-1] > 0 else np.inf
    if condition > _MAX_CONDITION:
        raise CalibrationError(
            f"the spots do not determine all cells (condition {condition:.0f}, at most {_MAX_CONDITION:.0f}): "
            "put the weight near every cell and in the middle; cell positions can only be found on a board that bends"
        )
    return condition


def _sd(rows: Floats) -> Floats:
    """Of the unknowns, for equations of unit accuracy."""
    return np.asarray(np.sqrt(np.diag(np.linalg.pinv(rows.T @ rows))))


def _check_weights(weights: Floats) -> None:
    if not len(weights):
        raise CalibrationError("no spot was measured")
    if not (np.isfinite(weights) & (weights > 0)).all():
        raise CalibrationError("a calibration weight must be more than 0 g")


def _check_responses(differences: Floats, noise: Floats, samples: int) -> None:
    for cell in range(differences.shape[1]):
        counts = differences[:, cell]
        if not np.isfinite(counts).all():
            raise CalibrationError(f"cell {cell} gives no values")
        # The largest of n spots of pure noise reaches some standard deviations by itself; half a count is rounding.
        if np.abs(counts).max() <= _RESPONSE * max(noise[cell] * np.sqrt(2 / samples), 1e-9):
            raise CalibrationError(
                f"cell {cell} does not respond to the weight (its counts change by {np.abs(counts).max():.3g}, "
                f"noise {noise[cell]:.3g}): check its cable, or put the weight near it"
            )


def _check_spots(spots: Floats, cells: Floats | None, k: int) -> None:
    if k == 1:
        return
    need = max(3, k) if cells is None else 3
    if len(spots) < need:
        raise CalibrationError(f"{len(spots)} spots are too few: at least {need}, better {need + 2}")
    reference = spots if cells is None else cells
    spread = np.linalg.svd(spots - spots.mean(axis=0), compute_uv=False) / np.sqrt(len(spots))
    board = float(np.ptp(reference, axis=0).max()) / 2
    if spread[1] < _MIN_SPREAD * board:
        raise CalibrationError("the spots lie on one line: put the weight also to both sides of it")


def _check_gains(gain: Floats) -> None:
    if not np.isfinite(gain).all():
        raise CalibrationError("the measurements contradict each other")
    usual = float(np.median(gain))
    for cell, one in enumerate(gain):
        if one * usual <= 0:
            raise CalibrationError(
                f"cell {cell} has the gain {one:.4g} g per count, the others about {usual:.4g}: is it wired the wrong "
                "way round, or do two cells stand in each other's place?"
            )
        if not 1 / _MAX_GAIN_RATIO <= one / usual <= _MAX_GAIN_RATIO:
            raise CalibrationError(
                f"cell {cell} has the gain {one:.4g} g per count, the others about {usual:.4g}: is it at the position "
                "that the configuration says, and does it carry the board?"
            )
