"""Clusters: what belongs together, where it is, and what is only an edge."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from floor_rooms import WALLS, cast, sweep

from tms_agents.floor import Sensor
from tms_agents.floor.scan.background import BACKGROUND, FOREGROUND
from tms_agents.floor.scan.rays import rays
from tms_agents.floor.scan.segmentation import DARK, FADES, Segmenter

SENSOR = Sensor(sweep(), (0.05, 0.05, math.pi / 4))
STEP = np.diff(SENSOR.sweep.angles, append=SENSOR.sweep.angles[-1] + 0.003)
EMPTY = cast(SENSOR, [], WALLS)


def clusters(
    circles: list[tuple[float, float, float]],
    change: dict[int, float] | None = None,
    posts: tuple[tuple[float, float, float], ...] = (),
) -> Any:
    ranges, empty = cast(SENSOR, [*circles, *posts], WALLS), cast(SENSOR, posts, WALLS)
    for beam, value in (change or {}).items():
        ranges[beam] = value
    states = np.where(ranges < empty - 0.03, FOREGROUND, BACKGROUND).astype(np.int8)
    segment = Segmenter(np.abs(STEP), math.radians(15.0))
    return segment(ranges, states, np.zeros(ranges.size, np.bool_), empty, empty, rays(SENSOR, SENSOR.pose, []))


def test_a_round_thing_is_one_cluster_at_its_middle() -> None:
    (cluster,) = clusters([(2.0, 1.5, 0.06)])
    assert math.hypot(cluster["x"] - 2.0, cluster["y"] - 1.5) < 0.012
    assert abs(cluster["width"] - 0.12) < 0.025
    assert not cluster["cut"]


def test_two_legs_are_two_clusters_and_one_before_the_other_is_cut() -> None:
    assert len(clusters([(2.0, 1.5, 0.05), (2.0, 1.8, 0.05)])) == 2
    near, far = sorted(clusters([(1.5, 1.5, 0.05), (2.5, 2.38, 0.06)]), key=lambda cluster: float(cluster["near"]))
    assert far["cut"]
    assert not near["cut"]


def test_a_post_before_the_middle_of_a_thing_does_not_split_it() -> None:
    (cluster,) = clusters([(2.4, 2.4, 0.12)], posts=((1.2, 1.2, 0.012),))
    assert float(cluster["width"]) > 0.18


def test_a_beam_that_saw_a_bit_of_both_sides_of_an_edge_is_dropped() -> None:
    (cluster,) = clusters([(2.0, 1.5, 0.06)])
    between = 0.5 * (float(cluster["near"]) + EMPTY[cluster["last"] + 1])
    assert len(clusters([(2.0, 1.5, 0.06)], {int(cluster["last"]) + 1: between})) == 1


def test_what_lies_right_before_a_wall_does_not_join_it_where_one_beam_passes_for_the_wall() -> None:
    """Two beams meet a thing 5 cm before the wall; noise lets one of them end where the wall might be."""
    (wide,) = clusters([(4.9, 2.0, 0.02)])
    beam, wall = int(wide["first"]), EMPTY
    for beside in (beam - 1, beam + 1):
        change = {k: float(wall[k]) for k in range(int(wide["first"]) - 1, int(wide["last"]) + 2)}
        (one,) = clusters([], {**change, beam: wall[beam] - 0.035, beside: wall[beside] - 0.025})
        assert not one["attached"]


def test_nothing_gives_nothing_and_a_missing_beam_does_not_split() -> None:
    assert len(clusters([])) == 0
    (cluster,) = clusters([(2.0, 1.5, 0.06)])
    middle = int(cluster["first"] + cluster["last"]) // 2
    assert len(clusters([(2.0, 1.5, 0.06)], {middle: float("nan")})) == 1


def test_what_is_seen_directly_and_in_a_mirror_is_one() -> None:
    """Two beams meet a disc at its middle: one directly, one by way of a mirror; a third sees another in the mirror."""
    n = SENSOR.sweep.angles.size
    ranges, states = np.full(n, 4.0), np.full(n, BACKGROUND, np.int8)
    mirror = ((0.0, 3.0), (3.0, 3.0))
    beams = rays(SENSOR, SENSOR.pose, [mirror])
    places = []
    for there, mirrored in (((1.5, 0.5), False), ((1.5, 0.52), True), ((1.0, 1.5), True)):
        x, y = there[0], 6.0 - there[1] if mirrored else there[1]
        bearing = math.atan2(y - SENSOR.pose[1], x - SENSOR.pose[0]) - SENSOR.pose[2]
        k = int(np.argmin(np.abs(SENSOR.sweep.angles - bearing)))
        ranges[k - 2 : k + 3], states[k - 2 : k + 3] = math.hypot(x - 0.05, y - 0.05), FOREGROUND
        assert bool(beams[k, 8] < ranges[k]) == mirrored
        places.append(there)
    segment = Segmenter(np.abs(STEP), math.radians(15.0))
    found = segment(ranges, states, np.zeros(n, np.bool_), np.full(n, 4.0), np.full(n, 4.0), beams)
    assert sorted(one["mirror"] >= 0 for one in found) == [False, True]
    for one in found:
        assert min(math.hypot(one["x"] - x, one["y"] - y) for x, y in (places[0], places[2])) < 0.05


def shoe(away: float, turn: float) -> list[tuple[float, float, float]]:
    """A shoe whose heel is ``away`` m from the laser; its toes point ``turn`` rad aside of the beam."""
    u, v = math.cos(math.pi / 4), math.sin(math.pi / 4)
    c, s = math.cos(math.pi / 4 + turn), math.sin(math.pi / 4 + turn)
    steps = np.linspace(0.0, 1.0, 30)
    return [
        (0.05 + away * u + 0.185 * k * c, 0.05 + away * v + 0.185 * k * s, 0.033 + 0.013 * k) for k in steps.tolist()
    ]


@pytest.mark.parametrize("turn", [0.0, 0.03, 0.06, 0.1, 0.2, math.pi / 2])
@pytest.mark.parametrize("away", [1.5, 2.0, 2.7, 3.5])
def test_a_shoe_is_one_cluster_also_where_it_points_at_the_laser(away: float, turn: float) -> None:
    (cluster,) = clusters(shoe(away, turn))
    face = clusters(shoe(away, 0.0)[:1])[0]
    assert int(cluster["first"]) <= int(face["first"])
    assert int(cluster["last"]) >= int(face["last"])


def test_what_stands_behind_the_edge_of_something_is_no_shred_of_it() -> None:
    found = clusters([(2.0, 2.0, 0.05), (2.3, 2.15, 0.05)])
    assert len(found) == 2
    thin = clusters([(2.0, 2.0, 0.05), (2.35, 2.19, 0.008)])
    assert len(thin) == 2


@pytest.mark.parametrize(
    ("around", "behind", "mostly", "is_open", "cut"),
    [
        (np.inf, np.inf, np.inf, 1, 0),
        (np.inf, 4.0, 4.0, 0, FADES),
        (np.inf, 4.0, np.inf, DARK, 0),
        (4.0, 4.0, 4.0, 0, 0),
    ],
    ids=["nothing is known", "a wall", "a wall that seldom echoes", "seen past"],
)
def test_silence_beside_something_tells_that_it_is_dark_only_where_what_is_behind_is_not_silent(
    around: float, behind: float, mostly: float, is_open: int, cut: int
) -> None:
    """One beam meets something; those beside it bring ``around`` m, and ``behind`` m is known there, ``mostly`` seen.

    Where nothing comes back anyhow there may be more of it.
    """
    n = EMPTY.size
    ranges, states = np.full(n, around), np.full(n, BACKGROUND, np.int8)
    ranges[n // 2], states[n // 2] = 3.0, FOREGROUND
    segment = Segmenter(np.abs(STEP), math.radians(15.0))
    known = np.full(n, behind), np.full(n, mostly)
    (cluster,) = segment(ranges, states, np.zeros(n, np.bool_), *known, rays(SENSOR, SENSOR.pose, []))
    assert (int(cluster["open"]), int(cluster["cut"])) == (is_open, cut)
