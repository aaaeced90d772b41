"""Resampling is unbiased, whatever the weights are; paths are those of the ancestors."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.slam.ancestry import Ancestry
from tms_agents.slam.weights import effective_number, low_variance, normalised

logarithms = st.lists(st.floats(-50, 50), min_size=1, max_size=30).map(np.array)


@given(logarithms, st.integers(1, 60), st.floats(0, 1, exclude_max=True))
def test_children_are_the_weight_rounded_up_or_down(values, count, uniform):
    weights = normalised(values)
    children = np.bincount(low_variance(weights, count, uniform), minlength=len(weights))
    assert children.sum() == count
    assert (np.abs(children - count * weights) < 1 + 1e-6).all()


def test_on_average_the_children_are_the_weight():
    weights = normalised(np.log(np.array([0.5, 0.13, 0.07, 0.3])))
    arms = (np.arange(10_000) + 0.5) / 10_000
    children = sum(np.bincount(low_variance(weights, 7, float(u)), minlength=4) for u in arms) / len(arms)
    np.testing.assert_allclose(children, 7 * weights, atol=2e-3)


@given(logarithms, st.floats(-1e4, 1e4))
def test_only_differences_of_log_weights_count(values, shift):
    np.testing.assert_allclose(normalised(values), normalised(values + shift), atol=1e-9)
    assert 1 - 1e-9 <= effective_number(normalised(values)) <= len(values) + 1e-9


@given(
    st.integers(1, 5), st.lists(st.lists(st.integers(0, 4), min_size=5, max_size=5), max_size=120), st.integers(0, 99)
)
def test_paths_are_those_of_the_ancestors(particles, generations, seed):
    random = np.random.default_rng(seed)
    tree, paths = Ancestry(particles), [[] for _ in range(particles)]
    for parents in generations:
        poses = random.normal(size=(particles, 3))
        tree.append(poses)
        paths = [[*path, pose] for path, pose in zip(paths, poses, strict=True)]
        chosen = np.array(parents[:particles], dtype=np.int32) % particles
        tree.resample(chosen)
        paths = [paths[parent] for parent in chosen]
    for n in range(particles):
        np.testing.assert_array_equal(tree.path(n), np.array(paths[n]).reshape(-1, 3))


def test_what_nobody_comes_from_is_forgotten():
    tree = Ancestry(10)
    for _ in range(5000):
        tree.append(np.zeros((10, 3)))
        tree.resample(np.zeros(10, dtype=np.int32))
    assert len(tree.path(3)) == 5000
    assert tree.nodes < 20_000
