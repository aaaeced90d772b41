"""Several lasers: their poses are refined from walkers that they see together; a mirror is one more of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from floor_rooms import WALLS, Room, box, sweep, thing, together, walker

from tms_agents.floor import Appeared, FloorEstimator, Scene, Sensor
from tms_agents.floor.scan.rays import rays, reflection

TRUE = {"A": (0.05, 0.05, math.pi / 4), "B": (4.95, 3.95, -3 * math.pi / 4)}
#: Walls on both sides of it.
WIDE = sweep(541, 1.5 * math.pi)
WAY = [(9.0, 4.8, 1.0), (14.0, 1.0, 1.0), (19.0, 1.0, 3.0), (24.0, 4.0, 3.0), (29.0, 4.0, 1.2), (34.0, 1.5, 2.0)]


def test_a_pose_that_is_a_little_wrong_is_corrected_by_common_walkers() -> None:
    room = Room(walker(WAY), sensors={name: Sensor(sweep(), pose) for name, pose in TRUE.items()})
    believed = dict(room.sensors)
    x, y, heading = TRUE["B"]
    believed["B"] = Sensor(sweep(), (x + 0.03, y - 0.02, heading + 0.008))
    estimator, _ = room.play(34.0, FloorEstimator(believed))
    before = np.array([0.03, -0.02])
    after = np.array(estimator.poses()["B"][:2]) - np.array(TRUE["B"][:2])
    assert estimator.poses()["A"] == TRUE["A"]
    assert np.hypot(*after) < 0.5 * np.hypot(*before)
    assert abs(estimator.poses()["B"][2] - heading) < 0.008


@pytest.mark.parametrize("longer", [0.99, 1.01])
def test_two_lasers_tell_each_other_how_their_rulers_err(longer: float) -> None:
    """One measures everything too long or too short, the other one right; no walls are known."""
    room = Room(walker(WAY), sensors={name: Sensor(sweep(), pose) for name, pose in TRUE.items()})
    estimator = FloorEstimator(room.sensors)
    for name, t, ranges in room.scans(34.0):
        estimator.scan(name, t, ranges * (longer if name == "B" else 1.0))
    scales = estimator.range_scales()
    assert abs(scales["B"] * longer - 1.0) < 0.006
    assert abs(scales["A"] - 1.0) < 0.006
    again = FloorEstimator.from_dict(estimator.to_dict(), room.sensors)
    assert again.range_scales() == scales and again.poses() == estimator.poses()


def test_a_scale_that_is_told_is_not_learned_from_another_laser() -> None:
    room = Room(walker(WAY), sensors={name: Sensor(sweep(), pose, 1.0) for name, pose in TRUE.items()})
    estimator = FloorEstimator(room.sensors)
    for name, t, ranges in room.scans(34.0):
        estimator.scan(name, t, ranges * (1.01 if name == "B" else 1.0))
    assert estimator.range_scales() == pytest.approx({"A": 1.0, "B": 1.0}, abs=0.001)


def test_walls_tell_where_a_laser_stands_and_its_restart_knows() -> None:
    room = Room(walker(WAY), sensors={name: Sensor(WIDE, pose) for name, pose in TRUE.items()})
    believed = {name: Sensor(WIDE, (x + 0.04, y - 0.03, heading + 0.02)) for name, (x, y, heading) in TRUE.items()}
    scene = Scene(region=[(0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)])
    estimator, _ = room.play(34.0, FloorEstimator(believed, scene=scene))
    for name, pose in TRUE.items():
        assert estimator.poses()[name] == pytest.approx(pose, abs=0.008)
    again = FloorEstimator.from_dict(estimator.to_dict(), believed, scene=scene)
    assert again.poses() == estimator.poses()


def test_beams_go_on_behind_a_mirror() -> None:
    sensor = Sensor(sweep(181, math.pi), (1.0, 1.0, 0.0))
    mirror = ((3.0, 0.0), (3.0, 2.0))
    beams = rays(sensor, sensor.pose, [mirror])
    ahead = beams[90]
    assert 2.0 <= ahead[8] <= 2.1
    # Half a metre behind the glass is half a metre before it.
    assert np.allclose(ahead[4:6] + 2.5 * ahead[6:8], (2.5, 1.0))
    assert beams[0, 8] == math.inf
    matrix, offset = reflection(mirror)
    assert np.allclose(matrix @ np.array([2.0, 1.0]) + offset, (4.0, 1.0))


def test_what_only_the_mirror_shows_is_seen_where_it_is() -> None:
    # The laser looks along the room; a post hides the thing, the mirror in the right wall shows it.
    pose = (0.3, 2.0, 0.0)
    mirror = ((5.0, 0.2), (5.0, 3.8))
    matrix, offset = reflection(mirror)
    far = 2 * 5.0
    world = thing(3.2, 2.9, 0.06, 12.0)

    def mirrored(t: float) -> list[tuple[float, float, float]]:
        seen = []
        for x, y, radius in world(t):
            image = matrix @ np.array([x, y]) + offset
            seen.append((float(image[0]), float(image[1]), radius))
        return seen

    # The mirrored room stands behind the glass; the direct view of the thing is taken away.
    walls = [*(wall for wall in WALLS if wall[0] != 5.0 or wall[2] != 5.0), (0.0, 0.0, far, 0.0), (far, 4.0, 0.0, 4.0)]
    walls.append((far, 0.0, far, 4.0))
    walls += box(1.75, 2.47, 0.3, 0.3)
    room = Room(mirrored, lambda t: walls, sensors={"A": Sensor(sweep(1081, math.pi / 2, 12.0), pose)})
    _, events = room.play(24.0, scene=Scene(mirrors=[mirror]))
    (born,) = [event for event in events if isinstance(event, Appeared)]
    assert math.hypot(born.xy[0] - 3.2, born.xy[1] - 2.9) < 0.03


def test_free_space_counts_from_whichever_sensor_sees_it() -> None:
    room = Room(
        together(walker([(9.0, 4.9, 2.0), (12.0, 2.5, 2.0), (15.0, 4.9, 2.0)]), thing(2.2, 1.9, 0.05, 12.5, 20.0)),
        # A panel hides the thing from the first sensor.
        lambda t: (*WALLS, (0.6, 0.9, 0.9, 0.6)),
        sensors={name: Sensor(sweep(), pose) for name, pose in TRUE.items()},
    )
    estimator, events = room.play(24.0)
    assert len([event for event in events if isinstance(event, Appeared) and event.kind == "object"]) == 1
    assert not [label for label in estimator.labels() if label.kind == "object"]
