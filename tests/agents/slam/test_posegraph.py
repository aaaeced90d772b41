"""Loops bend the path to where it was; a false one does not."""

from __future__ import annotations

import numpy as np

from tms_agents.slam.closures import Closure, consistent
from tms_agents.slam.geometry import between, compose
from tms_agents.slam.posegraph import Edges, optimise

SIZE = 80


def ring() -> tuple[np.ndarray, Edges, np.ndarray]:
    """(truth, chain with an odometry that turns wrongly, path by that odometry)."""
    angle = np.linspace(0, 2 * np.pi, SIZE, endpoint=False)
    truth = np.column_stack([10 * np.cos(angle), 10 * np.sin(angle), angle + np.pi / 2])
    truth = between(truth[0], truth)
    seen = between(truth[:-1], truth[1:]) + np.array([0.0, 0.0, 0.004])
    path = [truth[0]]
    for step in seen:
        path.append(compose(path[-1], step))
    information = np.tile(np.diag([1e3, 1e3, 1e4]), (SIZE - 1, 1, 1))
    keys = np.arange(SIZE)
    return truth, Edges(keys[:-1], keys[1:], seen, information), np.array(path)


def loop(truth: np.ndarray, start: int, end: int, wrong: float = 0.0) -> Edges:
    seen = between(truth[start], truth[end]) + np.array([wrong, 0.0, 0.0])
    return Edges(np.array([start]), np.array([end]), seen[None], np.diag([1e4, 1e4, 1e5])[None])


def test_one_loop_closes_the_ring():
    truth, chain, path = ring()
    assert np.hypot(*(path - truth)[-1, :2]) > 0.5
    bent = optimise(path, chain, loop(truth, 0, SIZE - 1))
    assert np.hypot(*(bent - truth)[:, :2].T).max() < 0.35
    assert np.hypot(*(bent - truth)[-1, :2]) < 0.02
    np.testing.assert_allclose(bent[0], path[0], atol=1e-9)


def test_what_fits_already_stays():
    truth, _, _ = ring()
    keys = np.arange(SIZE)
    chain = Edges(keys[:-1], keys[1:], between(truth[:-1], truth[1:]), np.tile(np.eye(3), (SIZE - 1, 1, 1)))
    np.testing.assert_allclose(optimise(truth, chain, loop(truth, 3, 60)), truth, atol=1e-9)


def test_the_switch_lets_a_false_loop_go():
    truth, chain, path = ring()
    good = loop(truth, 0, SIZE - 1)
    false = loop(truth, 5, 40, wrong=4.0)
    both = Edges(
        *(np.concatenate([getattr(good, n), getattr(false, n)]) for n in ("start", "end", "measured", "information"))
    )
    start = optimise(path, chain, good)
    bent = optimise(start, chain, both, switch=10.0)
    assert np.hypot(*(bent - truth)[:, :2].T).max() < 0.5
    chi2 = both.chi2(bent)
    assert chi2[0] < 30 < chi2[1]


def test_revisits_must_bear_each_other_out():
    way = np.arange(120.0)
    path = np.column_stack([np.concatenate([way[:60], way[:60]]), np.zeros(120), np.zeros(120)])

    def closure(anchor: int, key: int, shift: float, fit: float = 0.95) -> Closure:
        seen = between(path[anchor], path[key]) + np.array([shift, 0.0, 0.0])
        return Closure(anchor, key, seen, np.eye(3), fit)

    right = [closure(10 + 4 * n, 72 + 4 * n, 0.05) for n in range(5)]
    one_door_off = [closure(12, 73, 4.0), closure(20, 81, 4.0), closure(24, 85, 4.0)]
    alone = [closure(50, 118, -3.0)]
    kept = consistent(right + one_door_off + alone, path, way)
    assert kept[:5].all()
    assert not kept[5:].any()
    assert len(consistent([], path, way)) == 0
