"""What is put down beside somebody is a thing, whatever hides it or him; and his own foot is his own again."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tms_agents.floor.feet.prints import follow
from tms_agents.floor.movers.review import CONFIRM, NOTHING, Waits, review
from tms_agents.floor.scan.background import BACKGROUND, BEYOND, FOREGROUND, Background
from tms_agents.floor.scan.freespace import guard
from tms_agents.floor.scan.furniture import Furniture
from tms_agents.floor.scan.segmentation import CLUSTER
from tms_agents.floor.settings import FloorSettings
from tms_agents.floor.state import BODY, PRINT, empty

NOW = 100.0
WAITS = Waits(confirm_s=0.35, confirm_m=0.25, leave_s=1.5, hidden_s=60.0, stale_s=1.0)
#: Something new stands right before a laser of three beams, so that nothing behind it is seen.
COVERED = (np.full(3, 0.5), np.full(3, FOREGROUND, np.int8), np.full(3, 5.0), np.zeros(3), -0.05, 0.05)


def seen(prints: np.ndarray, t: float, width: float = 0.1, cut: int = 0) -> None:
    """One cluster at (1, 0), or nothing at all where its width is 0."""
    clusters = np.zeros(1 if width else 0, CLUSTER)
    clusters["x"], clusters["width"], clusters["near"], clusters["n"] = 1.0, width, 1.0, round(100 * width)
    clusters["spacing"], clusters["mirror"], clusters["cut"] = 0.01, -1, cut
    follow(clusters, np.zeros(clusters.size, np.int64), prints, 0, t, COVERED)


@pytest.mark.parametrize(("by_hand", "rested"), [(1, 1.8), (0, 0.0)])
def test_what_a_hand_put_there_is_the_same_after_who_put_it_has_passed_before_it(by_hand: int, rested: float) -> None:
    prints = empty(PRINT, 1)
    for k in range(8):
        seen(prints, 0.1 * k)
    prints["given"] = by_hand
    for k in range(8, 18):
        seen(prints, 0.1 * k, width=0.0)
    seen(prints, 1.8)
    assert 1.8 - prints["rested"][0] == pytest.approx(rested)


def test_what_hardly_ever_shows_both_edges_is_as_wide_as_it_mostly_looks() -> None:
    prints = empty(PRINT, 1)
    for k in range(60):
        seen(prints, 0.1 * k, *((0.02, 0) if k == 30 else (0.06, 1)))
    assert prints["whole"] == 1
    assert prints["width"] == pytest.approx(0.06, abs=0.01)


def face(between: float) -> list[tuple[float, float]]:
    """Width and wholeness of what has gone, 3.5 m away; three beams in its middle end at ``between``."""
    n = 60
    centre, weight, missing = np.zeros((n, 4)), np.zeros((n, 4)), np.zeros((n, 4))
    centre[:, 0], weight[:, 0] = 5.0, 0.4
    centre[15:41, 1], weight[15:41, 1], missing[15:41, 1] = 3.5, 0.4, 9.0
    centre[30:33, 0], weight[30:33, 1], missing[30:33, 1] = between, 0.0, 0.0
    rays = np.zeros((n, 10))
    rays[:, 2] = 1.0
    background = Background(n, 0.005, FloorSettings())
    background.centre, background.weight, background.missing = centre, weight, missing
    view = SimpleNamespace(background=background, rays=rays, step=0.005, last=NOW)
    return [(round(piece.width, 3), piece.whole) for piece in Furniture().pieces(view)]


def test_what_was_moved_from_behind_the_leg_of_a_table_is_one_piece() -> None:
    assert face(between=2.0) == [(0.455, 1.0)]
    assert [width for width, _ in face(between=5.0)] == [0.263, 0.14]


def test_what_shows_a_bit_of_a_thing_at_its_edge_is_not_learned() -> None:
    """The last beam but one sees a bit of the wall, too; the first now the leg of a table, now the thing behind it."""
    ranges = np.array([5.0, 3.0, 3.0, 3.0, 3.9, 5.0, 5.0])
    states = np.array([BACKGROUND, BEYOND, FOREGROUND, FOREGROUND, FOREGROUND, BACKGROUND, BACKGROUND], np.int8)
    claimed = np.zeros(7, np.bool_)
    claimed[2:4] = True
    guard(ranges, states, claimed)
    assert claimed.tolist() == [True, True, True, True, True, True, False]
    ranges[1], claimed[:] = 4.5, [False, False, True, True, False, False, False]
    guard(ranges, states, claimed)
    assert not claimed[1]


@pytest.mark.parametrize(
    ("away", "stepped", "action"), [(0.5, False, NOTHING), (4.0, False, CONFIRM), (0.5, True, CONFIRM)]
)
def test_nobody_begins_with_a_foot_that_came_beside_somebody_and_has_never_moved(
    away: float, stepped: bool, action: int
) -> None:
    bodies = empty(BODY, 2)
    bodies["used"], bodies["seen"], bodies["a_seen"], bodies["b_seen"] = 1, NOW, NOW, NOW
    bodies["hits"] = bodies["looks"] = bodies["score"] = 30
    bodies["confirmed"], bodies["x"], bodies["y"] = [1, 0], [2.0 + away, 2.6], [0.7, 0.0]
    bodies["first"] = bodies["a_since"] = NOW - 2.9
    bodies["x0"], bodies["b_since"] = 2.0, NOW - 0.5
    if stepped:
        bodies["a_since"] = NOW - 1.0
    actions = np.zeros(2, np.int64)
    review(bodies, NOW, 0.1, COVERED, WAITS, actions, False, True, False)
    assert actions[1] == action
