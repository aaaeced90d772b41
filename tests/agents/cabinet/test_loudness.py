"""Samples of loud moments count less, without being told when these are."""

from __future__ import annotations

import numpy as np

from tms_agents.cabinet.blocks import Block
from tms_agents.cabinet.loudness import Loudness

LEVEL = np.array([50.0, 20.0, -5.0, 0.0])


def recorded(rng: np.random.Generator, loud: float, seconds: float = 2.0) -> list[Block]:
    """Blocks of four samples at 50 Hz; an antenna is on for 0.15 s of every 0.5 s."""
    t = np.arange(0.0, seconds, 0.02)
    sd = np.where(np.mod(t + rng.uniform(0, 0.5), 0.5) < 0.15, loud, 1.0) * 8.0
    samples = LEVEL + sd[:, None] * rng.standard_normal((len(t), 4))
    unit = np.full(4, (sd**2).mean())
    return [
        Block(float(t[i]), float(t[i + 3]), 4, samples[i : i + 4].mean(axis=0), unit / 4, samples[i : i + 4], unit)
        for i in range(0, len(t) - 3, 4)
    ]


def errors(loud: float) -> tuple[float, float, float]:
    """Mean squares of the errors of a plain and of a sharpened mean, and of the latter relative to its variance."""
    rng, loudness, squares = np.random.default_rng(5), Loudness(), []
    for _ in range(250):
        blocks = recorded(rng, loud)
        loudness.sharpen(blocks)
        means, variances = (np.array([block.sharp[i] for block in blocks if block.sharp]) for i in (0, 1))
        total = (1 / variances).sum(axis=0)
        plain = np.mean([block.mean for block in blocks], axis=0) - LEVEL
        sharp = (means / variances).sum(axis=0) / total - LEVEL
        squares.append([(plain**2).mean(), (sharp**2).mean(), (sharp**2 * total).mean()])
    a, b, c = np.mean(squares, axis=0)
    return float(a), float(b), float(c)


def test_loud_moments_cost_hardly_any_precision() -> None:
    plain, sharp, honest = errors(loud=2.0)
    # With perfect knowledge 0.68: the mean of the variances times the mean of their inverses.
    assert sharp < 0.8 * plain
    assert 0.8 < honest < 1.25


def test_steady_noise_is_left_alone() -> None:
    plain, sharp, honest = errors(loud=1.0)
    assert sharp < 1.1 * plain
    assert 0.8 < honest < 1.25
