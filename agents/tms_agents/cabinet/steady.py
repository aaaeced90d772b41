"""Is the load steady again, or still on its way? A slow hand and a light thing look alike for a moment.

The newest blocks are projected on the change so far, u. Two histories are compared, each with every possible beginning:
the load rose from its old level and then stayed (a hinge), or it is still rising (a ramp). It counts as steady when
staying is clearly more likely. Quick changes pass at once, slow ones of light things need more samples.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tms_agents.cabinet.blocks import Block
from tms_agents.cabinet.geometry import Array
from tms_agents.cabinet.settings import EstimatorSettings

#: Blocks that are looked at, lengths of the steady part that are tried (in multiples of the shortest), beginnings.
_LONGEST = 75
_LENGTHS = (1.0, 1.2, 1.4, 1.6, 2.0, 2.4, 3.0, 3.6, 4.4, 5.4, 6.6, 8.0)
_BEGINNINGS = 24
#: A change is clear whose chi-square is more than this: some 100 g on a board with cells that scatter by 8 g.
_CLEAR = 400.0
#: Misfit of one block beyond which it tells nothing (a bump of the hand, say).
_CAP = 9.0
#: A thing that still rocks by this share of its weight is as good as steady.
_ROCKING = 0.003


def steady_tail(blocks: Sequence[Block], old: Array, old_variance: Array, settings: EstimatorSettings) -> list[Block]:
    """The newest blocks at one level, [] while the load may still be on its way there.

    ``blocks`` begin at the ``old`` level, (k,) g, if they are known so far back.
    """
    blocks = blocks[-_LONGEST:]
    least = _least_length(blocks, settings.settle_clear_s)
    if not least:
        return []
    means = np.array([b.mean for b in blocks]) - old
    variances = np.array([b.variance for b in blocks])
    times = np.array([0.5 * (b.start + b.end) for b in blocks])
    now = means[-least:].mean(axis=0)
    if float((now**2 / (variances[-least:].mean(axis=0) / least + old_variance)).sum()) < _CLEAR:
        least = _least_length(blocks, settings.settle_s)
        if not least:
            return []
    for length in sorted({min(math.ceil(least * factor), len(blocks)) for factor in _LENGTHS}):
        tail = slice(-length, None)
        change, variance = means[tail].mean(axis=0), variances[tail].mean(axis=0) / length + old_variance
        changed = bool((change**2 / variance).sum() > 12.0 + 2 * len(change))
        direction = change / variance if changed else 1.0 / variance
        along, noise = means @ direction, variances @ direction**2
        trend, trend_sd = _trend(times[tail], along[tail], noise[tail])
        size = float(along[tail].mean())
        if abs(trend) > settings.settle_sd * math.hypot(trend_sd, _ROCKING * size / settings.settle_s):
            return []  # the newest ones move: longer runs will not do better
        scatter = ((means[tail] - means[tail].mean(axis=0)) ** 2 / variances[tail]).sum()
        if scatter > chi_square_limit(settings.settle_sd + 1.0, (length - 1) * means.shape[1]) + (
            (length * _ROCKING**2) * (change**2 / variances[tail].mean(axis=0)).sum()
        ):
            return []
        if float(((along[tail] - size) ** 2 / noise[tail]).sum()) > chi_square_limit(
            settings.settle_sd + 1.0, length - 1
        ) + (length * (_ROCKING * size) ** 2 / float(noise[tail].mean())):
            return []
        if not changed:
            return _extended(blocks, length)
        if _stays(times, along, noise, length) > settings.settle_odds:
            longest = len(_extended(blocks, length))
            if longest == len(blocks):
                return list(blocks)
            # Of these, those that fit best to a rise that ended where they begin.
            lengths = np.unique(np.linspace(length, longest, 16).astype(int))
            fits = [_ended(times, along, noise, int(n)) for n in lengths]
            return list(blocks[-int(lengths[int(np.argmin(fits))]) :])
    return []


def _stays(times: Array, along: Array, noise: Array, length: int) -> float:
    """Log-likelihood ratio of a rise that ended ``length`` blocks ago to one that goes on."""
    if length >= len(times):
        return 0.0
    ramp = _misfit(np.maximum(times - _starts(times, len(times) - length), 0.0), along, 1.0 / noise)
    return 0.5 * (float(ramp.min()) - _ended(times, along, noise, length))


def _ended(times: Array, along: Array, noise: Array, length: int) -> float:
    """Misfit of the best rise that ended ``length`` blocks ago, straight or at once."""
    turn = len(times) - length
    if turn < 1:
        return float(((along - along.mean()) ** 2 / noise).sum())
    starts = _starts(times, turn)
    # The hinge ends half a block before the steady part.
    corner = 0.5 * (times[turn - 1] + times[turn])
    hinges = np.minimum(np.maximum(times - starts, 0.0), np.maximum(corner - starts, 1e-3))
    step = (np.arange(len(times)) >= turn).astype(float)
    return float(_misfit(np.vstack([hinges, step]), along, 1.0 / noise).min())


def _starts(times: Array, turn: int) -> Array:
    """Beginnings of a rise to try, (m, 1) s: half a block before some block before ``turn``."""
    early = np.unique(np.geomspace(1, turn, min(_BEGINNINGS, turn)).astype(int))
    return np.asarray(0.5 * (times[turn - early] + times[turn - early + 1]))[:, None]


def _misfit(shapes: Array, along: Array, weights: Array) -> Array:
    """Capped sum of squares of each of ``shapes`` (m, n), fitted to the series (n,)."""
    scale = (shapes * (weights * along)).sum(axis=1) / np.maximum((shapes**2 * weights).sum(axis=1), 1e-12)
    left = (along - scale[:, None] * shapes) ** 2 * weights
    return np.asarray(np.minimum(left, _CAP).sum(axis=1))


def _least_length(blocks: Sequence[Block], seconds: float) -> int:
    for length in range(2, len(blocks) + 1):
        # A block is told by its first and last sample; the pause to the one before belongs to it.
        begin = blocks[-length - 1].end if length < len(blocks) else blocks[-length].start
        if blocks[-1].end - begin >= seconds - 1e-9:
            return length
    return 0


def _trend(times: Array, values: Array, variances: Array) -> tuple[float, float]:
    """Slope of ``values`` and its standard deviation, weighted least squares."""
    weights = 1.0 / variances
    from_mean = times - (weights @ times) / weights.sum()
    power = float(weights @ from_mean**2)
    return float((weights * from_mean) @ values) / power, 1.0 / math.sqrt(power)


def _extended(blocks: Sequence[Block], length: int) -> list[Block]:
    """The newest ``length`` blocks and those before them that are at the same level."""
    tail = list(blocks[-length:])
    mean, mean_var = average(tail)
    freedom = len(mean)
    for block in reversed(blocks[:-length]):
        distance, both = block.mean - mean, block.variance + mean_var
        if distance.sum() ** 2 > 6.0 * both.sum() or (distance**2 / both).sum() > chi_square_limit(2.5, freedom):
            break
        tail.insert(0, block)
        mean, mean_var = average(tail)
    return tail


def average(blocks: Sequence[Block]) -> tuple[Array, Array]:
    """Mean (k,) weighted by quietness, and its variance (k,)."""
    means, variances = (np.array(part) for part in zip(*(b.sharp or (b.mean, b.variance) for b in blocks), strict=True))
    weights = 1.0 / variances.mean(axis=1)
    weights /= weights.sum()
    mean = weights @ means
    # Slow vibration scatters more than the noise of the samples tells.
    freedom = (len(blocks) - 1) * len(mean)
    scatter = float(((means - mean) ** 2 / variances).sum()) / freedom if freedom else 1.0
    return mean, (weights**2) @ variances * max(1.0, scatter)


def restlessness(blocks: Sequence[Block], change: Array) -> float:
    """How much more than noise the blocks scatter along ``change``, (k,): about 1 for a thing, more for an arm."""
    direction = change / blocks[-1].variance
    along = np.array([b.mean for b in blocks]) @ direction
    noise = np.array([b.variance for b in blocks]) @ direction**2
    rocking = (_ROCKING * float(direction @ change)) ** 2
    return float(((along - along.mean()) ** 2 / (noise + rocking)).sum()) / max(len(blocks) - 1, 1)


def chi_square_limit(sd: float, freedom: int) -> float:
    """Value of chi-square with ``freedom`` degrees that is as improbable as ``sd`` deviations (Wilson-Hilferty)."""
    share = 2.0 / (9.0 * freedom)
    # Two-sided deviations of one variable and the one-sided tail of chi-square: a little less is close enough.
    return float(freedom * (1.0 - share + (sd - 0.15) * math.sqrt(share)) ** 3)
