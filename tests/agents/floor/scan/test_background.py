"""The background of one sensor: learned while people pass, raised, remembered, drifting."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tms_agents.floor.scan.background import BACKGROUND, BEYOND, FOREGROUND, NO_ECHO, UNKNOWN, Background
from tms_agents.floor.scan.furniture import Furniture
from tms_agents.floor.settings import FloorSettings

NOBODY = np.zeros(30, np.bool_)


def learn(background: Background, ranges: np.ndarray, seconds: float, noise: float = 0.004, seed: int = 0) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(round(seconds * 10)):
        scan = ranges + rng.normal(0.0, noise, ranges.size)
        background.classify(scan)
        background.learn(scan, NOBODY, 0.1)


@pytest.fixture
def learned() -> Background:
    background = Background(30, math.radians(0.5), FloorSettings())
    learn(background, np.full(30, 3.0), 8.0)
    return background


def test_what_is_nearer_is_foreground_and_what_is_farther_is_not(learned: Background) -> None:
    scan = np.full(30, 3.0)
    scan[5], scan[10], scan[15], scan[20] = 2.95, 3.5, np.inf, np.nan
    states = learned.classify(scan)
    assert [states[i] for i in (0, 5, 10, 15, 20)] == [BACKGROUND, FOREGROUND, BEYOND, NO_ECHO, UNKNOWN]


def test_who_passes_while_it_is_learned_is_not_background() -> None:
    background = Background(30, math.radians(0.5), FloorSettings())
    rng = np.random.default_rng(1)
    for k in range(80):
        scan = np.full(30, 3.0) + rng.normal(0.0, 0.004, 30)
        scan[(k // 4) % 30] = 1.5
        background.classify(scan)
        background.learn(scan, NOBODY, 0.1)
    scan = np.full(30, 3.0)
    scan[3] = 1.5
    assert background.classify(scan)[3] == FOREGROUND


def test_where_nothing_echoes_anything_is_foreground() -> None:
    background = Background(30, math.radians(0.5), FloorSettings())
    learn(background, np.full(30, np.inf), 8.0)
    assert background.classify(np.full(30, 2.0))[7] == FOREGROUND


def test_what_has_gone_is_raised_soon_and_what_returns_is_known(learned: Background) -> None:
    learn(learned, np.full(30, 4.0), 3.0)
    assert learned.classify(np.full(30, 4.0))[0] == BACKGROUND
    assert learned.classify(np.full(30, 3.5))[0] == FOREGROUND
    assert learned.classify(np.full(30, 3.0))[0] == BACKGROUND


@pytest.mark.parametrize("hidden_s", [0.0, 60.0])
def test_a_piece_has_gone_since_its_place_was_free_however_long_it_was_hidden_then(
    learned: Background, hidden_s: float
) -> None:
    scan = np.full(30, 3.0)
    scan[12:16] = 4.0
    learn(learned, scan, 2.0)
    scan[10:18] = 1.0
    for _ in range(round(10 * hidden_s)):
        learned.classify(scan)
        learned.learn(scan, scan == 1.0, 0.1)
    angles = np.radians(0.5) * np.arange(30)
    rays = np.stack([np.zeros(30), np.zeros(30), np.cos(angles), np.sin(angles)], axis=1)
    view = SimpleNamespace(background=learned, rays=rays, step=math.radians(0.5), last=500.0)
    (piece,) = Furniture().pieces(view)
    assert piece.t == pytest.approx(500.0 - hidden_s - 2.0, abs=0.11)


def test_for_a_laser_that_sees_nothing_any_more_nothing_has_gone_lately(learned: Background) -> None:
    """Else whatever is put near that place would be the piece that had gone before the laser died."""
    scan = np.full(30, 3.0)
    scan[12:16] = 4.0
    learn(learned, scan, 2.0)
    angles = np.radians(0.5) * np.arange(30)
    rays = np.stack([np.zeros(30), np.zeros(30), np.cos(angles), np.sin(angles)], axis=1)
    view = SimpleNamespace(background=learned, rays=rays, step=math.radians(0.5), last=None)
    assert not Furniture().pieces(view)
    view.last = learned.seconds
    (piece,) = Furniture().pieces(view)
    assert piece.t == pytest.approx(learned.seconds - 2.0, abs=0.11)


def test_it_is_known_until_when_the_place_of_something_was_empty(learned: Background) -> None:
    came = learned.seconds
    scan = np.full(30, 3.0)
    for k in range(50):
        scan[10:15] = 2.0
        scan[14] = 3.0 if k % 2 else 2.0  # beside its edge
        learned.classify(scan)
        learned.learn(scan, scan == 2.0, 0.1)
    assert learned.seen_past(10, 14, 2.0) == pytest.approx(came, abs=0.11)
    assert learned.seen_past(10, 14, 3.0) == np.inf
    assert learned.seen_past(20, 24, 2.0) == pytest.approx(learned.seconds)


def test_it_follows_a_slow_drift(learned: Background) -> None:
    for k in range(60):
        learn(learned, np.full(30, 3.0 - 0.001 * k), 2.0, seed=k)
    assert (learned.classify(np.full(30, 2.94)) == BACKGROUND).all()
    assert learned.classify(np.full(30, 3.3))[0] == BEYOND


def test_what_is_kept_is_not_learned(learned: Background) -> None:
    scan = np.full(30, 2.0)
    for _ in range(6000):
        learned.classify(scan)
        learned.learn(scan, ~NOBODY, 0.1)
    assert (learned.classify(scan) == FOREGROUND).all()


def test_furniture_is_adopted_at_once(learned: Background) -> None:
    beams = np.arange(10, 20)
    learned.adopt(beams, np.full(10, 2.2))
    scan = np.full(30, 3.0)
    scan[10:20] = 2.2
    assert (learned.classify(scan) == BACKGROUND).all()


def test_what_is_adopted_is_new_whatever_it_replaces() -> None:
    """Beams that see four surfaces in turn: another one begins, and those that had gone are gone as before."""
    background = Background(30, math.radians(0.5), FloorSettings())
    for r in (2.0, 3.0, 4.0, 5.0):
        learn(background, np.full(30, r), 6.0)
    background.adopt(np.arange(30), np.full(30, 2.5), 0.1)
    assert (background.classify(np.full(30, 2.5)) == BACKGROUND).all()
    here = np.abs(background.centre - 2.5) < 1e-9
    assert here.any(axis=1).all()
    assert (background.times[here] == 1.0).all() and (background.seen_at[here] == background.seconds).all()
    assert ((background.missing > 0.0) == (background.centre < 4.5) & ~here).all(), "all but the last had gone"


def test_what_has_gone_comes_back_whole_and_anything_less_is_something_new() -> None:
    """A cupboard, ten beams wide, was moved away a while ago; a small thing lies where its front was."""
    cupboard = np.full(30, 4.0)
    cupboard[10:20] = 3.0
    background = Background(30, math.radians(0.5), FloorSettings())
    learn(background, cupboard, 8.0)
    learn(background, np.full(30, 4.0), 8.0)
    assert (background.classify(cupboard) == BACKGROUND).all()
    for beams in (slice(13, 16), slice(10, 13), slice(8, 22)):
        scan = np.full(30, 4.0)
        scan[beams] = 3.0
        assert (background.classify(scan)[beams] == FOREGROUND).all()
    hidden = cupboard.copy()
    hidden[14:25] = 1.0
    assert (background.classify(hidden)[10:14] == BACKGROUND).all()


def test_what_is_put_where_a_slanting_front_was_seconds_ago_is_new_and_stays_so() -> None:
    """A trolley has just been pushed away: what lies there then is as far off as a part of it was."""
    wall, trolley = np.full(40, 5.6), np.full(40, 5.6)
    trolley[10:30] = 5.0 + 0.02 * np.arange(20)
    background = Background(40, math.radians(0.25), FloorSettings())
    learn(background, trolley, 30.0)
    learn(background, wall, 3.5)
    thing = wall.copy()
    thing[17:23] = 5.19
    for _ in range(50):
        assert (background.classify(thing)[18:22] == FOREGROUND).all()
        background.learn(thing, np.zeros(40, np.bool_), 0.1)


def test_something_new_is_not_learned_within_seconds_though_the_room_is_hardly_known(learned: Background) -> None:
    learn(learned, np.full(30, 3.0), 12.0)
    scan = np.full(30, 3.0)
    scan[12:16] = 2.9
    learn(learned, scan, 5.0)
    assert learned.classify(scan)[13] == FOREGROUND
