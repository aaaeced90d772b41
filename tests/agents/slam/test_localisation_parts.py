"""What localisation is made of: how many particles are enough, what hangs together, how well a scan fits a map."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.slam.fit import MEAN, NEAR, UNKNOWN, WRONG, Fit
from tms_agents.slam.hypotheses import groups, hypotheses
from tms_agents.slam.known import known_map
from tms_agents.slam.sampling import bins_of, drawn_until_enough, enough, everywhere

#: A wall of 10 m along y = 5 in free space; nothing is known above y = 8.
OCCUPANCY = np.zeros((200, 200))
OCCUPANCY[100:102] = 1.0
OCCUPANCY[160:] = np.nan
KNOWN = known_map(OCCUPANCY, (-5.0, 0.0), 0.05)


@given(st.integers(2, 10_000), st.sampled_from([0.02, 0.05, 0.2]))
def test_more_bins_need_more_particles_and_a_smaller_error_too(bins, error):
    assert enough(bins + 1, error) > enough(bins, error)
    assert enough(bins, error) > enough(bins, 2 * error)


def test_the_number_is_that_of_the_chi_square_quantile():
    """Fox 2003, equation 4: n = chi2 quantile (k - 1 degrees) / (2 error)."""
    from scipy.stats import chi2

    for bins in (5, 50, 500):
        assert enough(bins, 0.1) == pytest.approx(chi2.ppf(0.99, bins - 1) / 0.2, rel=0.02)


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 3.0))
def test_wider_spread_draws_more(seed, spread):
    random = np.random.default_rng(seed)
    weights = np.full(2000, 1 / 2000)
    counts = [
        len(
            drawn_until_enough(
                random.normal(0, width, (2000, 3)),
                weights,
                least=30,
                most=3000,
                error=0.1,
                bins=(0.4, 0.2),
                random=random,
            )
        )
        for width in (0.001, spread)
    ]
    assert 30 <= counts[0] <= counts[1] <= 3000


def test_particles_that_weigh_nothing_have_no_children():
    weights = np.zeros(50)
    weights[7] = 1.0
    poses = np.zeros((50, 3))
    random = np.random.default_rng(0)
    parents = drawn_until_enough(poses, weights, least=30, most=100, error=0.1, bins=(0.4, 0.2), random=random)
    assert set(parents.tolist()) == {7}


@given(st.floats(-3.1, 3.1), st.floats(-50, 50), st.floats(-50, 50))
def test_what_touches_is_one_group_wherever_it_is(heading, x, y):
    random = np.random.default_rng(1)
    cloud = np.array([x, y, heading]) + random.normal(0, [0.05, 0.05, 0.02], (60, 3))
    other = cloud + np.array([5.0, 0.0, 0.0])
    both = np.concatenate([cloud, other])
    both[:, 2] = (both[:, 2] + np.pi) % (2 * np.pi) - np.pi
    group = groups(both)
    assert len(set(group[:60])) == len(set(group[60:])) == 1
    assert group[0] != group[60]


def test_headings_wrap_around():
    poses = np.array([[0.0, 0.0, np.pi - 0.05], [0.0, 0.0, -np.pi + 0.05]])
    assert len(set(groups(poses))) == 1
    one = hypotheses(poses, np.array([0.5, 0.5]))[0]
    assert abs(one.pose[2]) == pytest.approx(np.pi)
    assert one.spread_rad == pytest.approx(0.05)
    assert (bins_of(poses, 0.4, np.pi / 18)[:, 2] < 36).all()


def test_the_heaviest_hypothesis_comes_first():
    poses = np.array([[0.0, 0, 0], [9.0, 0, 0], [9.1, 0, 0], [20.0, 0, 0]])
    found = hypotheses(poses, np.array([0.3, 0.3, 0.3, 0.1]))
    assert [one.weight for one in found] == pytest.approx([0.6, 0.3, 0.1])
    assert found[0].pose[0] == pytest.approx(9.05)


@settings(max_examples=20)
@given(st.integers(0, 1000))
def test_particles_are_everywhere_and_only_where_a_robot_can_be(seed):
    poses = everywhere(KNOWN, 4000, np.random.default_rng(seed))
    assert (np.abs(poses[:, 1] - 5.05) > 0.1).all()
    assert (poses[:, 1] < 8.0).all()
    counts = np.histogram2d(poses[:, 0], poses[:, 2], bins=(10, 8), range=((-5, 5), (-np.pi, np.pi)))[0]
    assert counts.min() > 20


def test_a_scan_fits_where_it_was_made():
    fit = Fit(KNOWN, 0.1)
    wall = np.column_stack([np.full(40, 2.0), np.linspace(-3, 3, 40)])  # 2 m ahead
    right, near, beyond = fit(
        np.array([[0.0, 3.05, np.pi / 2], [0.0, 3.55, np.pi / 2], [0.0, 5.3, np.pi / 2]]), wall, np.zeros(2)
    )
    assert right[MEAN] < 0.1
    assert right[NEAR] == 1.0
    assert near[MEAN] > 1.0
    assert near[WRONG] == 1.0
    assert beyond[UNKNOWN] == 0.0
    up = fit(np.array([[0.0, 6.5, np.pi / 2]]), wall, np.zeros(2))[0]
    assert up[UNKNOWN] == 1.0
    assert right[MEAN] < up[MEAN] < near[MEAN]


def test_beams_do_not_pass_through_walls():
    fit = Fit(KNOWN, 0.1)
    behind = np.array([[0.0, 3.0, np.pi / 2]])
    points = np.array([[2.9, 0.0]])  # ends 0.9 m behind the wall, in free space
    assert fit(behind, points, np.zeros(2))[0, WRONG] == 1.0
    through = np.array([[4.0, 0.0], [2.0, 0.0]])
    around = fit(behind, through, np.zeros(2), through=False)[0]
    assert around[NEAR] == 0.5
