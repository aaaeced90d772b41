"""Particles: few where they agree, up to the most where they do not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.slam import ParticleFilter, Settings
from tms_agents.slam.kld import enough


@given(st.integers(0, 1000), st.floats(0.0, 0.5), st.integers(1, 60))
def test_a_wider_spread_never_needs_fewer(seed, spread, least):
    poses = np.random.default_rng(seed).standard_normal((40, 3))
    narrow, wide = enough(1e-4 * poses, least, 60), enough(spread * poses, least, 60)
    assert narrow == least <= wide <= 60


def test_the_formula_is_that_of_the_paper():
    """Two bins and 99 %: chi-squared with one degree of freedom, 6.63, over twice the divergence; approximately."""
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert enough(poses, 1, 1000) == pytest.approx(6.63 / 0.3, abs=1.0)


def test_the_filter_keeps_to_the_range_and_repeats_itself(log):
    numbers = []
    for _ in range(2):
        particles = ParticleFilter(Settings(particles=20, least_particles=5, seed=2), log.laser)
        numbers.append([])
        for n in range(60):
            particles.process(log.odometry[n], log.driven[n], log.points(n))
            numbers[-1].append(len(particles.poses))
        assert particles.path().shape == (60, 3)
    assert numbers[0] == numbers[1]
    assert 5 <= min(numbers[0]) < 20 == max(numbers[0])
