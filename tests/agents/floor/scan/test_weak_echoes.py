"""A laser whose echoes fade: walls that seldom echo are walls, and what is seldom seen is no thing and nobody."""

from __future__ import annotations

import math

import numpy as np
import pytest
from floor_rooms import cast, sweep, walker

from tms_agents.floor import FloorEstimator, FloorSettings, Sensor
from tms_agents.floor.feet.prints import follow
from tms_agents.floor.scan.background import BACKGROUND, FOREGROUND, Background
from tms_agents.floor.scan.segmentation import CLUSTER, backed
from tms_agents.floor.state import PRINT, empty
from tms_agents.simulation.floor_world import LASERS, FloorWorld

#: Beams, and so far apart at 4 m (m): all of them see 1.7 m.
BEAMS, APART_M = 60, 0.028
NOBODY = np.zeros(BEAMS, np.bool_)


def learned(wall: np.ndarray, echoes: float, seconds: float, seed: int = 0) -> Background:
    """The background where ``wall`` (n,) m echoes so often; inf: nothing does."""
    background = Background(BEAMS, APART_M / 4.0, FloorSettings())
    rng = np.random.default_rng(seed)
    for _ in range(round(10 * seconds)):
        scan = np.where(rng.random(BEAMS) < echoes, wall + rng.normal(0.0, 0.005, BEAMS), np.inf)
        background.classify(scan)
        background.learn(scan, NOBODY, 0.1)
    return background


@pytest.mark.parametrize(("seconds", "echoes"), [(5.0, 0.1), (8.0, 0.1), (60.0, 0.03)])
def test_a_long_wall_that_seldom_echoes_is_a_wall(seconds: float, echoes: float) -> None:
    background = learned(np.full(BEAMS, 4.0), echoes, seconds)
    assert (background.classify(np.full(BEAMS, 4.0)) == BACKGROUND).mean() > 0.95
    assert (background.classify(np.full(BEAMS, 3.0)) == FOREGROUND).all()


def test_what_is_short_and_was_seen_twice_is_none() -> None:
    background = learned(np.full(BEAMS, np.inf), 1.0, 8.0)
    scan = np.full(BEAMS, np.inf)
    scan[20:24] = 4.0
    for k in range(120):
        now = scan if k % 60 < 6 else np.full(BEAMS, np.inf)
        background.classify(now)
        background.learn(now, NOBODY, 0.1)
    assert (background.classify(scan)[20:24] == FOREGROUND).all()


def test_what_comes_back_again_and_again_where_nothing_else_does_belongs_to_the_room() -> None:
    background = learned(np.full(BEAMS, np.inf), 1.0, 8.0)
    scan = np.full(BEAMS, np.inf)
    scan[30] = 4.0
    for k in range(181):
        now = scan if k % 30 == 0 else np.full(BEAMS, np.inf)
        background.classify(now)
        background.learn(now, NOBODY, 0.1)
    assert background.classify(scan)[30] == BACKGROUND
    scan[30] = 3.0
    assert background.classify(scan)[30] == FOREGROUND


@pytest.mark.parametrize(("echoes", "missed"), [(0.9, True), (0.5, True), (0.15, False)])
def test_silence_tells_something_only_where_the_background_is_seldom_silent(echoes: float, missed: bool) -> None:
    background = learned(np.full(BEAMS, 4.0), echoes, 60.0)
    background.classify(np.full(BEAMS, np.inf))
    assert np.isfinite(background.longest).all()
    assert (np.isfinite(background.steady).mean() > 0.95) == missed
    assert np.isfinite(background.steady).any() == missed


@pytest.mark.parametrize("known", [False, True])
def test_no_echo_at_all_speaks_against_what_is_faint_unless_something_is_missed_there(known: bool) -> None:
    """Five beams to (2, 0), and a wall behind it or none."""
    none, wall = np.full(5, np.inf), np.full(5, 4.0 if known else np.inf)
    sight = (none, np.ones(5, np.int8), wall, np.zeros(3), -0.02, 0.01)
    clusters, prints = np.zeros(1, CLUSTER), empty(PRINT, 4)
    clusters["x"], clusters["width"], clusters["near"], clusters["n"], clusters["spacing"] = 2.0, 0.04, 2.0, 2, 0.02
    clusters["mirror"] = -1
    for k in range(12):
        found = clusters if k % 4 == 0 else clusters[:0]
        follow(found, np.zeros(found.size, np.int64), prints, 0, 0.1 * k, sight)
    assert prints["hits"][0] == 3
    assert prints["looks"][0] == (3 if known else 12)
    assert prints["mutes"][0] == (9 if known else 0)


def test_while_a_room_is_learned_a_few_beams_before_nothing_known_are_nobody() -> None:
    clusters = np.zeros(3, CLUSTER)
    clusters["n"], clusters["gap"], clusters["x"] = (2, 2, 5), (np.inf, 0.4, np.inf), (1.0, 2.0, 3.0)
    assert clusters[: backed(clusters)]["x"].tolist() == [2.0, 3.0]


@pytest.mark.parametrize("seed", [1501, 1503, 1505, 1506])
def test_nobody_is_told_before_somebody_comes(seed: int) -> None:
    """Half of the walls are so far that they seldom echo; who comes first comes later."""
    world = FloorWorld("one", seed, feet="legs", laser=LASERS["faint"], duration=9.0)
    estimator = FloorEstimator({name: Sensor(m.laser.sweep(), m.reported) for name, m in world.sensors.items()})
    events = [event for scan in world.scans() for event in estimator.scan(scan.sensor, scan.t, scan.ranges)]
    assert not world.truth()["movers"]
    assert not events


@pytest.mark.parametrize(("seed", "silent"), [(0, 0.8), (1, 0.85), (2, 0.85), (3, 0.85), (4, 0.9), (5, 0.9)])
def test_who_stands_where_a_beam_or_two_come_back_is_not_lost(seed: int, silent: float) -> None:
    """He walks up to 4.3 m and back; there so many of the beams that meet him bring nothing, and all others, too."""
    laser = Sensor(sweep(beams=683, fan=math.radians(240), reach=5.6), (0.0, 0.0, 0.0))
    walk = walker([(9.0, 1.5, 1.0), (12.5, 4.2, -0.6), (17.0, 4.2, -0.6), (20.0, 2.0, -1.0)])
    rng, away = np.random.default_rng(seed), []
    estimator = FloorEstimator({"A": laser})
    for k in range(195):
        t = 0.1 * k
        legs = walk(t)
        ranges = cast(laser, legs, ())
        ranges[rng.random(683) < np.where(ranges > 3.6, silent, 0.0)] = np.inf
        estimator.scan("A", t, np.round(ranges + rng.normal(0.0, 0.006, 683), 3))
        if legs and t > 11.0:
            x, y = np.mean([leg[:2] for leg in legs], axis=0)
            away += [min((math.hypot(x - one.xy[0], y - one.xy[1]) for one in estimator.labels()), default=9.0)]
    assert {one.id for one in estimator.labels()} == {1}
    assert np.mean(np.array(away) < 0.5) > 0.97


@pytest.mark.parametrize("seed", [0, 2, 4, 9])
@pytest.mark.parametrize("echoes", [1.0, 0.2])
def test_who_comes_is_told_as_soon_before_walls_that_seldom_echo(seed: int, echoes: float) -> None:
    """That nothing comes back from where he began does not tell that something dark still stands there."""
    laser = Sensor(sweep(beams=683, fan=math.radians(240), reach=5.6), (0.0, 0.0, 0.0))
    walls = [(4.0, -4.0, 4.0, 4.0), (-4.0, 4.0, 4.0, 4.0), (-4.0, -4.0, 4.0, -4.0)]
    walk, empty_room = walker([(9.0, 2.0, -1.5), (12.0, 2.0, 1.5)]), cast(laser, [], walls)
    rng, told = np.random.default_rng(seed), np.inf
    estimator = FloorEstimator({"A": laser})
    for k in range(97):
        ranges = cast(laser, walk(0.1 * k), walls)
        ranges[(rng.random(683) > echoes) & (ranges >= empty_room - 1e-6)] = np.inf
        estimator.scan("A", 0.1 * k, np.round(ranges + rng.normal(0.0, 0.006, 683), 3))
        told = min(told, 0.1 * k) if estimator.labels() else told
    assert 9.0 < told < 9.55
