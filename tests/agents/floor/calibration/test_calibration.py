"""Poses of lasers, from walls and from walkers, on rooms with furniture and noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from floor_rig import DEPTH, OUTLINE, WIDTH, Room, sweep
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tms_agents.floor.calibration.calibrating import by_walkers, by_walls, static_points
from tms_agents.floor.calibration.walkers import Track, register, walker_tracks
from tms_agents.floor.recordings.recorded import Recorded, rows_of
from tms_agents.floor.scan.walls import fit_walls
from tms_agents.floor.settings import FloorSettings
from tms_client.cli import CommandError

SWEEP = sweep()


def turned(angle):
    return abs(math.atan2(math.sin(angle), math.cos(angle)))


def looked(room, pose, scans=20, beams=SWEEP):
    return np.array([room.ranges(beams, pose) for _ in range(scans)])


@settings(max_examples=15)
@given(
    x=st.floats(0.5, WIDTH - 0.5),
    y=st.floats(0.5, DEPTH - 0.5),
    theta=st.floats(-3.1, 3.1),
    off=st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
    seed=st.integers(0, 100),
)
# As many points at a wall as at the right pose, but a centimetre off, and nearer to where the search began.
@example(x=2.6158185640823244, y=1.5, theta=2.4837689694309746, off=(0.0, 0.078125, 0.22735308527274883), seed=77)
def test_walls_tell_the_pose_whatever_stands_before_them(x, y, theta, off, seed):
    room, random = Room(seed), np.random.default_rng(seed)
    for n in range(6):  # furniture
        room.put(f"f{n}", *random.uniform(0.2, 3.8, 2), random.uniform(0.05, 0.25))
    if any(math.dist((x, y), disc[:2]) < disc[2] + 0.3 for disc in room.discs.values()):
        return
    points = static_points(SWEEP, looked(room, (x, y, theta)))
    start = (x + off[0], y + off[1], theta + off[2])
    try:
        fit = fit_walls(points, OUTLINE, start)
    except ValueError as error:
        assert "one direction" in str(error)  # said, not guessed
        return
    if fit.matched < 0.3:
        return  # furniture hides the walls; the command refuses it
    assert math.dist(fit.pose[:2], (x, y)) < 0.01
    assert turned(fit.pose[2] - theta) < math.radians(0.3)
    # Where walls on one side alone are seen the ruler may err, and the pose with it.
    assert fit.rmse_m < 0.01 and (fit.sd[0] < 0.01 or fit.range_scale_sd > 0.002)


def test_people_who_walk_by_do_no_harm():
    room, pose, seen = Room(1), (2.5, 0.1, math.pi / 2), []
    for n in range(60):
        room.walk("somebody", 0.5 + 0.06 * n, 2.0, 0.0, 0.06 * n)
        seen.append(room.ranges(SWEEP, pose))
    fit = fit_walls(static_points(SWEEP, np.array(seen)), OUTLINE, (2.4, 0.2, 1.5))
    assert math.dist(fit.pose[:2], pose[:2]) < 0.005 and turned(fit.pose[2] - pose[2]) < 0.003


@pytest.mark.parametrize("upside_down", [False, True])
@pytest.mark.parametrize("theta", [1.3, math.pi / 2])
def test_a_laser_that_is_mounted_the_other_way_up(theta, upside_down):
    """The walls of a box fit it as well; the ruler tells that its left is its right."""
    room, pose = Room(1), (1.6, 0.1, theta)
    seen = looked(room, pose)
    by_ruler = (pose[0] + 0.03, pose[1] - 0.02, theta + 0.02)
    rows = rows_of(seen[:, ::-1] if upside_down else seen)
    recorded, said = Recorded("east", SWEEP, by_ruler, np.arange(len(seen)) / 10, rows), []
    if not upside_down:
        assert math.dist(by_walls(recorded, OUTLINE, said.append, force=False).pose[:2], pose[:2]) < 0.01
        return
    with pytest.raises(CommandError, match="mounted the other way up"):
        by_walls(recorded, OUTLINE, said.append, force=False)


def test_what_cannot_be_known_is_said():
    points = np.stack([np.linspace(-1, 1, 100), np.full(100, 2.0)], axis=1)  # one wall only
    with pytest.raises(ValueError, match="one direction only"):
        fit_walls(points, [(-50, -50), (50, -50), (50, 2), (-50, 2)], (0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="only 3 beams"):
        fit_walls(points[:3], OUTLINE, (0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="does not fit the outline"):
        fit_walls(points + 30.0, OUTLINE, (0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="at least three corners"):
        fit_walls(points, [(0, 0), (1, 1)], (0.0, 0.0, 0.0))


A, B = (0.1, 2.0, 0.0), (4.9, 0.3, 2.5)


def walk(seconds=26.0, people=1, offset=0.0):
    """Both lasers, out of step, see people on closed curves; B's clock is ``offset`` behind."""
    room, seen = Room(5), {"a": ([], []), "b": ([], [])}
    step = 0.05
    for n in range(int(seconds / step)):
        t = n * step
        for person in range(people if t > 6.0 else 0):
            turn = 0.35 * (t - 6.0) + 2.4 * person
            x, y = 2.5 + 1.3 * math.cos(turn), 2.0 + (1.0 - 0.4 * person) * math.sin(2 * turn)
            heading = math.atan2(2 * (1.0 - 0.4 * person) * math.cos(2 * turn), -1.3 * math.sin(turn))
            room.walk(f"p{person}", x, y, heading, 0.6 * (t - 6.0))
        name, pose = ("a", A) if n % 2 else ("b", B)
        seen[name][0].append(100 + t - (offset if name == "b" else 0.0))
        seen[name][1].append(room.ranges(SWEEP, pose))
    return [
        Recorded(name, SWEEP, pose, np.array(seen[name][0]), rows_of(np.array(seen[name][1])))
        for name, pose in (("a", A), ("b", B))
    ]


@pytest.mark.parametrize(("people", "offset"), [(1, 0.0), (1, 0.2), (2, 0.0)])
def test_walkers_tell_where_the_other_laser_is(people, offset):
    known, other = walk(people=people, offset=offset)
    found = register(walker_tracks(known, A), walker_tracks(other, (0.0, 0.0, 0.0)))
    assert math.dist(found.pose[:2], B[:2]) < 0.07
    assert turned(found.pose[2] - B[2]) < math.radians(1.5)
    assert found.offset_s == pytest.approx(offset, abs=0.11)
    assert found.rmse_m < 0.1 and found.places > 50


def test_nobody_walked():
    known, other = walk(seconds=5.0)
    with pytest.raises(ValueError, match="nobody was seen"):
        register(walker_tracks(known, A), walker_tracks(other, (0.0, 0.0, 0.0)))


def straight(seconds, y, seed=0, *, back=False):
    """Somebody walks 1 m/s along x, with a centimetre of noise."""
    t = np.arange(0.0, seconds, 0.1)
    x = seconds / 2 - t if back else t - seconds / 2
    noise = np.random.default_rng(seed).normal(0.0, 0.01, (len(t), 2))
    return Track(t, np.stack([x, np.full(len(t), y)], axis=1) + noise)


def test_two_who_walk_straight_do_not_tell_who_is_who():
    """One laser sees one of them, the other both: it stands on this side or on that one."""
    found = register([straight(4.0, 1.0, 1)], [straight(4.0, 1.0, 2), straight(4.0, 2.0, 3, back=True)])
    assert found.rival > 0.9


def test_a_way_that_is_too_short_for_a_direction_is_told_so():
    long, short = (register([straight(s, 1.0, 1)], [straight(s, 1.0, 2)]) for s in (20.0, 2.0))
    assert long.sd[1] < short.sd[1]


@pytest.mark.parametrize(
    ("people", "seconds", "says"),
    [(1, 26.0, ""), (1, 11.5, "sure enough"), (0, 9.0, "nobody was seen walking by both")],
)
def test_walkers_who_tell_too_little_are_refused(people, seconds, says):
    known, other = walk(seconds=seconds, people=people)
    said = []
    if not says:
        found = by_walkers(known, other, FloorSettings(), said.append, force=False)
        assert math.dist(found.pose[:2], B[:2]) < 0.07
        return
    with pytest.raises(CommandError, match=says):
        by_walkers(known, other, FloorSettings(), said.append, force=False)
