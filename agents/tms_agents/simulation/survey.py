"""The demo's robot, before anybody is up: it drives once around the room with wheels that slip and a laser that errs.

What comes out is a recording as `tms slam run` reads it: the map is made of that alone.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from tms_agents.simulation.floor_bench import furniture, walls
from tms_agents.simulation.floor_world.lasers import FINE, Mount
from tms_agents.simulation.floor_world.room import LiveRoom
from tms_agents.simulation.floor_world.shapes import Pose
from tms_agents.simulation.room import SPOTS, route
from tms_agents.simulation.world import Xy

#: Where the drive begins and what it looks at; the map's frame has its origin there.
START: Pose = (*SPOTS["dock"], math.pi / 2)
_STOPS = ("south", "bedside", "middle", "front of A", "north", "front of B", "east", "front of C", "dock", "meeting")
_SPEED, _TURNING, _STEP_S = 0.5, 0.8, 0.2
#: Standard deviations of the wheels: of the turn per rad, of the turn (rad) and the way per root of m.
_TURN_PER_RAD, _TURN_PER_M, _WAY_PER_M = 0.03, 0.02, 0.02
#: Every so-manieth beam is recorded.
_EVERY = 3


def recording(random: np.random.Generator) -> Iterator[str]:
    """Lines of a recording: odometry, which begins at zero, and scans, five each second."""
    mount = Mount(name="laser", laser=FINE, pose=START, reported=START)
    room = LiveRoom(walls(), furniture(), [mount], random)
    odometry = (0.0, 0.0, 0.0)
    before = START
    for number, pose in enumerate(poses()):
        odometry = _rolled(odometry, before, pose, random)
        before, t = pose, number * _STEP_S
        room.mounts["laser"] = replace(mount, pose=pose, reported=pose)
        ranges, _ = room.scan("laser", t)
        heard = np.where(np.isfinite(ranges) & (ranges < FINE.range_max_m), ranges, 0.0)[::_EVERY]
        yield json.dumps({"type": "odom", "t": t, "x": odometry[0], "y": odometry[1], "theta": odometry[2]})
        yield json.dumps(
            {
                "type": "scan",
                "t": t,
                "angle_min": FINE.first_angle,
                "angle_increment": _EVERY * FINE.step,
                "range_max": FINE.range_max_m,
                "ranges": [round(float(r), 3) for r in heard],
            }
        )


def poses() -> Iterator[Pose]:
    """Where the robot is, five times a second: it turns on the spot, then drives straight on."""
    x, y, theta = START
    yield START
    for here, there in pairwise([SPOTS["dock"], *route("dock", *_STOPS)]):
        way = _towards(here, there)
        turn = math.remainder(way - theta, 2 * math.pi)
        turns = math.ceil(abs(turn) / (_TURNING * _STEP_S))
        yield from ((x, y, theta + turn * n / turns) for n in range(1, turns + 1))
        theta = way
        steps = math.ceil(math.dist(here, there) / (_SPEED * _STEP_S))
        for n in range(1, steps + 1):
            x, y = (a + (b - a) * n / steps for a, b in zip(here, there, strict=True))
            yield (x, y, theta)


def _towards(here: Xy, there: Xy) -> float:
    return math.atan2(there[1] - here[1], there[0] - here[0])


def _rolled(odometry: Pose, before: Pose, now: Pose, random: np.random.Generator) -> Pose:
    """Odometry after the wheels went from one true pose to the next."""
    way = math.dist(before[:2], now[:2])
    turn = math.remainder(now[2] - before[2], 2 * math.pi)
    heading = odometry[2] + turn
    measured = way + _WAY_PER_M * math.sqrt(way) * random.normal()
    wrong = random.normal() * (_TURN_PER_M * math.sqrt(way) + _TURN_PER_RAD * abs(turn))
    return (
        odometry[0] + measured * math.cos(heading),
        odometry[1] + measured * math.sin(heading),
        heading + wrong,
    )
