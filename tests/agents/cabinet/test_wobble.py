"""Vibration near a multiple of the sampling rate, and things that wander while they are put down."""

from __future__ import annotations

import numpy as np
import pytest
from cabinet_bench import GEOMETRY, share

from tms_agents.cabinet.splitting import path_odds, split
from tms_agents.cabinet.steps import Step
from tms_agents.cabinet.wandering import misfit, pulls_of
from tms_agents.cabinet.wobble import Wobble

BLOCK_S, WHITE = 0.08, np.full(4, 16.0)


def listen(wobble: Wobble, swing_g: float, hertz: float, seconds: float, seed: int = 1, near: bool = True) -> None:
    random = np.random.default_rng(seed)
    phases = np.array([0.0, 1.0, 2.5, 4.0])
    for i in range(int(seconds / BLOCK_S)):
        t = i * BLOCK_S
        mean = swing_g * np.sin(2 * np.pi * hertz * t + phases) + random.normal(0, 4.0, 4)
        wobble.push(t, mean, WHITE, near)


@pytest.mark.parametrize("seed", range(5))
def test_white_noise_is_no_wobble(seed: int) -> None:
    wobble = Wobble(4)
    listen(wobble, 0.0, 1.0, 60.0, seed)
    assert (wobble.variance == 0).all()


@pytest.mark.parametrize("hertz", [0.4, 0.7, 1.0, 1.4])
def test_a_slow_swing_is_heard_within_seconds_and_forgotten(hertz: float) -> None:
    wobble = Wobble(4)
    listen(wobble, 15.0, hertz, 8.0)
    assert (wobble.variance > 15.0**2 / 2).all()
    listen(wobble, 0.0, hertz, 14.0)
    assert (wobble.variance == 0).all()


def test_far_from_the_level_nothing_is_learnt() -> None:
    wobble = Wobble(4)
    listen(wobble, 15.0, 0.7, 20.0, near=False)
    assert (wobble.variance == 0).all()


def test_a_compressor_is_heard_and_its_end_too() -> None:
    wobble = Wobble(4)
    for _ in range(600):
        wobble.hear(100.0, BLOCK_S)
    assert not wobble.shaking
    for _ in range(150):
        wobble.hear(180.0, BLOCK_S)
    assert wobble.shaking
    for _ in range(300):
        wobble.hear(100.0, BLOCK_S)
    assert not wobble.shaking


def put_down(tilt_m: float, blocks: int = 40) -> Step:
    """1.5 kg put down slowly, first beside its place by ``tilt_m`` in x."""
    random = np.random.default_rng(3)
    way = (np.arange(blocks) + 0.5) / blocks
    path = np.array([1500 * s * share(0.2 + tilt_m * (1 - s), 0.15) for s in way]) + random.normal(0, 4.0, (blocks, 4))
    noise, none = np.full((blocks, 4), 16.0), np.zeros(4)
    return Step(0.0, 3.2, 3.6, 1500 * share(0.2, 0.15), np.full(4, 4.0), none, none + 1.0, path, noise, 1.0)


def test_a_thing_that_is_set_upright_is_one_thing() -> None:
    tilted = split(put_down(0.012), GEOMETRY)
    assert tilted is None or tilted.gain < 8.0  # two things: far more, as below
    assert path_odds(put_down(0.012), 700 * share(0.25, 0.15), GEOMETRY) < 0.0


def test_two_things_one_after_the_other_are_two() -> None:
    random = np.random.default_rng(4)
    first, second = 700 * share(0.08, 0.08), 800 * share(0.38, 0.25)
    way = np.arange(20)[:, None] / 20
    path = np.vstack([way * first, first + way * second]) + random.normal(0, 4.0, (40, 4))
    none = np.zeros(4)
    step = Step(0.0, 3.2, 3.6, first + second, np.full(4, 4.0), none, none + 1.0, path, np.full((40, 4), 16.0), 1.0)
    found = split(step, GEOMETRY)
    assert found is not None and found.gain > 16.0
    assert abs(found.first.sum() - 700) < 70


def test_the_likelihood_of_wandering_is_that_of_a_normal_vector() -> None:
    """Against the density with the covariance written out."""
    random = np.random.default_rng(5)
    path = np.cumsum(np.abs(random.normal(30, 5, (6, 4))), axis=0)
    pulls = pulls_of(path, GEOMETRY) / 5.0
    values = random.normal(0, 1, (6, 4))
    basis = pulls.reshape(24, 4)
    covariance = np.eye(24) + basis @ basis.T
    flat = values.reshape(24)
    expected = float(flat @ np.linalg.solve(covariance, flat) + np.linalg.slogdet(covariance)[1])
    assert misfit(values, pulls) == pytest.approx(expected, rel=1e-9)
