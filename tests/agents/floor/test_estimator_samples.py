"""The estimator on recorded samples: simulated ones with truth, real ones with the number of people."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tms_agents.devices.scans import Sweep
from tms_agents.floor import Appeared, FloorEstimator, FloorEvent, Sensor, Vanished

pytestmark = pytest.mark.realdata


def play(path: Path) -> tuple[list[FloorEvent], dict[int, int]]:
    """All events of a recording, and in how many scans each mover was seen."""
    data: Any = np.load(path)
    n = data["ranges"].shape[1]
    if "angles" in data:
        angles, pose, period = data["angles"].astype(float), data["sensor_pose"].tolist(), 1 / float(data["scan_rate"])
    else:
        angles = float(data["angle_min"]) + np.arange(n) * float(data["angle_increment"])
        pose, period = (0.0, 0.0, 0.0), float(data["scan_time"])
    sweep = Sweep(angles, float(data["time_increment"]), period, float(data["range_min"]), float(data["range_max"]))
    estimator = FloorEstimator({"A": Sensor(sweep, (pose[0], pose[1], pose[2]))})
    events: list[FloorEvent] = []
    seen: dict[int, int] = {}
    times = np.maximum.accumulate(data["t"] - data["t"][0])
    for t, ranges in zip(times.tolist(), data["ranges"].astype(float), strict=True):
        events += estimator.scan("A", t, ranges)
        for label in estimator.labels():
            if label.kind == "mover" and not label.stale:
                seen[label.id] = seen.get(label.id, 0) + 1
    return events, seen


def objects(events: list[FloorEvent]) -> list[Appeared]:
    return [event for event in events if isinstance(event, Appeared) and event.kind == "object"]


@pytest.mark.parametrize("name", ["s1_floor", "s1_leg"])
def test_a_box_put_down_and_picked_up_is_one_label(shared_data: Path, name: str) -> None:
    events, _ = play(shared_data / f"floor/sim/{name}_A.npz")
    (born,) = objects(events)
    assert math.hypot(born.xy[0] - 2.465, born.xy[1] - 2.388) < 0.06
    (gone,) = [event for event in events if isinstance(event, Vanished) and event.label == born.label]
    assert gone.earliest <= 41.6
    assert 41.5 <= gone.latest < 43.0


@pytest.mark.parametrize("name", ["s3_floor", "s3_leg"])
def test_what_a_robot_and_a_foot_hide_is_kept(shared_data: Path, name: str) -> None:
    events, _ = play(shared_data / f"floor/sim/{name}_A.npz")
    gone = {event.label for event in events if isinstance(event, Vanished)}
    for x, y, taken in ((3.1921, 2.6879, False), (2.8446, 1.1513, False), (2.2346, 2.8643, True)):
        there = [event for event in objects(events) if math.hypot(event.xy[0] - x, event.xy[1] - y) < 0.12]
        assert len(there) == 1
        assert (there[0].label in gone) == taken


@pytest.mark.parametrize(
    ("name", "there"), [("s1_floor", 2), ("s1_leg", 2), ("s3_floor", 3), ("s3_leg", 3), ("s6_leg", 2)]
)
def test_everybody_who_comes_is_one_label_and_a_cabinet_that_is_moved_is_nobody(
    shared_data: Path, name: str, there: int
) -> None:
    events, _ = play(shared_data / f"floor/sim/{name}_A.npz")
    assert len([event for event in events if isinstance(event, Appeared) and event.kind == "mover"]) == there
    assert len([event for event in events if isinstance(event, Vanished)]) >= there


def test_of_a_black_cabinet_a_black_bin_and_a_chair_that_are_moved_one_piece_at_most_is_a_thing(
    shared_data: Path,
) -> None:
    events, _ = play(shared_data / "floor/sim/s6_leg_A.npz")
    things = [(2.71, 2.27), (1.96, 1.27)]
    false = [event for event in objects(events) if all(math.dist(event.xy, thing) > 0.12 for thing in things)]
    assert len(objects(events)) - len(false) == len(things)
    assert len(false) <= 1


@pytest.mark.parametrize(("name", "people"), [("tamu_people_1", 1), ("tamu_people_4", 1), ("tamu_people_5", 2)])
def test_the_number_of_people_of_real_recordings(shared_data: Path, name: str, people: int) -> None:
    events, seen = play(shared_data / f"floor/real/{name}.npz")
    assert len(seen) == people
    assert not objects(events)


def test_the_walker_of_the_laboratory_keeps_a_label(shared_data: Path) -> None:
    events, seen = play(shared_data / "floor/real/irvs_human_tracker3.npz")
    assert max(seen.values()) > 350
    assert not objects(events)
