"""A closed door is no piece of its wall: it stands a little deeper, and only as long as it is."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.slam.geometry import Floats
from tms_agents.slam.semidynamic.evidence import CELL_M, Beams, Worth, worth
from tms_agents.slam.semidynamic.models import ObjectModel
from tms_agents.slam.semidynamic.recesses import flanked, goes_on
from tms_agents.slam.semidynamic.shapes import shape_of

WIDTH, THICK = 0.7, 0.035
MODEL = ObjectModel(
    "door_small",
    (np.array([(0.0, -THICK / 2), (WIDTH, -THICK / 2), (WIDTH, THICK / 2), (0.0, THICK / 2)]),),
    np.array([0.35, THICK / 2, np.pi / 2]),
)
SHAPE = shape_of(MODEL)
#: The wall runs along x at this height, the door from here on; beams come from below.
WALL_Y, FROM_X = 1.2, 1.5


def seen_with(depth: float) -> Worth:
    """A wall with a door, ``depth`` behind it, which is always closed, with a laser's noise."""
    random = np.random.default_rng(3)
    x = random.uniform(0.3, 3.7, 20000)
    inside = (x > FROM_X) & (x < FROM_X + WIDTH)
    points = np.stack([x, WALL_Y + depth * inside + random.normal(0, 0.012, len(x))], axis=-1) / CELL_M
    hits, ends, course = np.zeros((100, 160), dtype=np.int32), np.zeros((100, 160, 2)), np.zeros((100, 160, 2))
    cells = points.astype(int)
    np.add.at(hits, (cells[:, 1], cells[:, 0]), 1)
    np.add.at(ends, (cells[:, 1], cells[:, 0]), points)
    course[..., 1] = hits
    beams = Beams(hits, np.zeros_like(hits), course, ends)
    return worth(beams, beams)


def share(depth: float, pose: Floats) -> float:
    """Of the wall that goes on past a door at ``pose``."""
    cells = seen_with(depth)
    return goes_on(
        pose, SHAPE.outline, SHAPE.normals, SHAPE.beyond, cells.towards, cells.wall, cells.surface,
        np.zeros(2), CELL_M,
    )  # fmt: skip


def closed(depth: float, along: float = 0.0, turned: bool = False) -> Floats:
    """In the gap, its face ``depth`` behind the wall."""
    y = WALL_Y + depth + THICK / 2
    return np.array([FROM_X + along + WIDTH, y, np.pi]) if turned else np.array([FROM_X + along, y, 0.0])


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("depth", [0.01, 0.03, 0.09])
def test_what_stands_a_little_deeper_is_no_wall(depth: float, turned: bool) -> None:
    assert share(depth, closed(depth, turned=turned)) < 0.2


def test_in_one_plane_it_is_a_piece_of_wall() -> None:
    assert share(0.0, closed(0.0)) > 0.8


@pytest.mark.parametrize("along", [-0.35, 0.35])
def test_half_on_the_door_it_is_a_piece_of_wall(along: float) -> None:
    assert share(0.01, closed(0.01, along)) > 0.3


@pytest.mark.parametrize("turn", [-0.03, 0.03])
def test_a_wall_seen_at_a_slant_stays_a_wall(turn: float) -> None:
    pose = closed(0.0) + np.array([0.0, -turn * WIDTH / 2, turn])
    assert share(0.0, pose) > 0.8


@pytest.mark.parametrize("off", [-0.05, -0.03, 0.03, 0.05])
@pytest.mark.parametrize("turn", [-0.08, 0.0, 0.08])
def test_before_a_wall_or_behind_it_a_panel_is_a_piece_of_it(off: float, turn: float) -> None:
    pose = closed(0.0) + np.array([0.0, off - turn * WIDTH / 2, turn])
    assert share(0.0, pose) > 0.8


def test_at_a_corner_a_piece_of_wall_is_still_a_piece_of_wall() -> None:
    # A fifth of the panel lies where the wall ends and another one, which stands back, is met.
    assert share(0.11, np.array([FROM_X - 0.8 * WIDTH, WALL_Y, 0.0])) > 0.45


def test_beams_that_end_before_a_wall_by_their_noise_are_the_walls() -> None:
    cells = seen_with(0.0)
    row = int(WALL_Y / CELL_M)
    assert cells.seen[row - 3 : row + 4, 20:140].max() < 0.02
    assert cells.always[row, 20:140].min() > 0.2


@pytest.mark.parametrize(("depth", "expected"), [(-0.3, [0.0] * 4), (0.12, [0.0, 0.0, 1.0, 0.0])])
def test_a_bin_before_a_wall_is_no_piece_of_it_and_one_whose_face_is_in_it_is(
    depth: float, expected: list[float]
) -> None:
    box = 0.15 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    shape = shape_of(ObjectModel("bin_box", (box,), np.array([0.15, 0.0, 0.0])))
    wall = np.zeros((100, 160), dtype=np.bool_)
    wall[int(WALL_Y / CELL_M) - 2 : int(WALL_Y / CELL_M) + 3] = True
    pose = np.array([2.0, WALL_Y + depth, np.pi])
    assert [round(flanked(pose, ends, wall, np.zeros(2), CELL_M), 6) for ends in shape.beyond] == expected
