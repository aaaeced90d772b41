"""Two maps in one: a drive laid onto the map of an earlier one, and what is left of things that were moved."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.robot.continuing import Before, aligned, merged
from tms_agents.slam.geometry import Floats, compose, inverse, transform
from tms_agents.slam.gridmap import GridMap
from tms_agents.slam.occupancy import HIGHEST, UNKNOWN

SIZE = 0.02
#: Walls of a room of 4 x 3 m with an alcove, and a bin that is moved.
CORNERS = [(0, 0), (4, 0), (4, 3), (2.5, 3), (2.5, 3.6), (1.5, 3.6), (1.5, 3), (0, 3), (0, 0)]
BIN = np.array([(x, y) for x in np.arange(1.0, 1.31, 0.02) for y in (1.0, 1.3)])


def points() -> Floats:
    parts = []
    for a, b in itertools.pairwise(CORNERS):
        steps = int(np.hypot(b[0] - a[0], b[1] - a[1]) / 0.01)
        parts.append(np.linspace(a, b, steps, endpoint=False))
    return np.concatenate(parts)


def drawn(places: Floats, free: float = 0.05) -> tuple[Floats, tuple[float, float]]:
    origin = (-0.2, -0.2)
    cells = np.full((200, 230), np.nan)
    cells[15:160, 15:205] = free
    at = np.floor((places - origin) / SIZE).astype(int)
    cells[at[:, 1], at[:, 0]] = 0.95
    return cells, origin


@settings(max_examples=8)
@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-0.08, 0.08), st.integers(0, 99))
def test_a_robot_that_was_nudged_finds_its_place(x: float, y: float, turn: float, seed: int) -> None:
    truth = np.array([2.0, 1.5, 0.7])
    cells, origin = drawn(np.concatenate([points(), BIN]))
    random = np.random.default_rng(seed)
    seen = transform(inverse(truth), points())
    seen = seen + random.normal(0, 0.012, seen.shape)
    said = truth + np.array([x, y, turn])
    found = aligned(Before(cells, origin, SIZE, {"B": BIN}, said), seen)
    off = compose(inverse(found), truth)
    assert np.hypot(*off[:2]) < 0.02 and abs(off[2]) < 0.01


def test_without_walls_it_is_where_it_was_said_to_be() -> None:
    pose = np.array([1.0, 2.0, 0.5])
    empty = Before(np.full((10, 10), np.nan), (0.0, 0.0), SIZE, {}, pose)
    assert np.array_equal(aligned(empty, points()), pose)
    cells, origin = drawn(points())
    assert np.array_equal(aligned(Before(cells, origin, SIZE, {}, pose), np.zeros((0, 2))), pose)


def test_what_was_moved_leaves_nothing_and_the_rest_stays() -> None:
    cells, origin = drawn(np.concatenate([points(), BIN]))
    before = Before(cells, origin, SIZE, {"B": BIN, "C": BIN + np.array([1.5, 0.0])}, np.zeros(3))
    # Only a corner far to the left was seen anew.
    seen = np.full((20, 30), UNKNOWN, dtype=np.uint8)
    seen[5:10] = HIGHEST
    whole, corner = merged(before, GridMap(seen, (-0.6, -0.3), SIZE), {"B": BIN + np.array([0.0, 1.0])})
    np.testing.assert_allclose(corner, (-0.6, -0.3))

    def at(x: float, y: float) -> float:
        return float(whole[int((y - corner[1]) / SIZE + 1e-6), int((x - corner[0]) / SIZE + 1e-6)])

    assert np.isnan([at(x, y) for x, y in BIN + 0.001]).all()
    assert at(2.01, 0.001) > 0.9 and at(2.01, 1.5) < 0.1 and at(-0.5, -0.15) > 0.9
    assert np.array_equal(cells, drawn(np.concatenate([points(), BIN]))[0], equal_nan=True)  # as it was given
