"""Whatever lasers deliver, the estimator goes on, and what it tells agrees; more than it has room for, too.

`make fuzz` plays many more rooms, with every access to an array checked.
"""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
from floor_listener import Listener
from numpy.typing import NDArray

from tms_agents.devices.scans import Sweep
from tms_agents.floor import FloorEstimator, Scene, Sensor

ROOMS = int(os.environ.get("TMS_ROOMS", "12"))
SCANS, LEARNED, RESTART = 200, 80, 150
#: What a beam may bring besides a range.
NO_RANGE = [np.nan, np.inf, 0.0, -1.0, 1e9, 65.533]
SCENE = Scene(
    region=[(0, 0), (5, 0), (5, 4), (0, 4)],
    gates=[[(4.5, 1), (5.5, 1), (5.5, 2), (4.5, 2)]],
    seats=[[(1, 1), (2, 1), (2, 2), (1, 2)]],
    mirrors=[((0, 1), (0, 3))],
    robots=[(0.4, 0.5)],
)


def any_lasers(random: np.random.Generator) -> dict[str, Sensor]:
    beams, round_rad = int(random.choice([8, 20, 181, 361, 726])), 2 * np.pi
    span = random.choice([random.uniform(0.5, round_rad - 0.01), round_rad * (beams - 1) / beams])
    angles = np.linspace(-span / 2, span / 2, beams)[:: random.choice([1, -1])]
    sweep = Sweep(angles, 1e-4, 0.1, float(random.choice([0.0, 0.02])), float(random.choice([4.0, 8.0, 1e9, np.inf])))
    poses = random.uniform((0, 0, -3), (5, 4, 3), (int(random.integers(1, 3)), 3))
    return {f"laser {number}": Sensor(sweep, tuple(pose)) for number, pose in enumerate(poses)}


class AnyRoom:
    """Walls, and before them noise, or up to two hundred pieces that stand or go, or nothing but one value."""

    def __init__(self, beams: int, random: np.random.Generator) -> None:
        self.random, self.beams = random, beams
        self.walls = random.uniform(1, 6, beams) if random.random() < 0.3 else np.full(beams, random.uniform(1, 6))
        self.kind = random.choice(["noise", "pieces", "flood"])
        count = int(random.integers(1, 200))
        self.at, self.near = random.uniform(0, beams, count), random.uniform(0.05, 6, count)
        self.width = random.integers(1, beams // 40 + 3, count)
        self.speed = random.normal(0, beams / 400, count) * (random.random() < 0.7)

    def ranges(self, k: int) -> NDArray[np.float64]:
        random = self.random
        ranges = self.walls + random.normal(0, 0.004, self.beams)
        if k > LEARNED or random.random() < 0.1:
            if self.kind == "noise":
                ranges = np.where(random.random(self.beams) < 0.3, random.uniform(0, 7, self.beams), ranges)
            elif self.kind == "flood":
                ranges[:] = random.choice(NO_RANGE)
            else:
                firsts = (self.at + self.speed * k).astype(int) % self.beams
                for first, width, near in zip(firsts, self.width, self.near, strict=True):
                    ranges[first : first + width] = np.minimum(ranges[first : first + width], near)
        if random.random() < 0.3:
            ranges[random.random(self.beams) < 0.5] = random.choice(NO_RANGE)
        return ranges

    def lights(self) -> NDArray[np.float64] | None:
        none = np.full(self.beams, np.nan)
        kinds = [None, none, 0 * none, np.zeros(self.beams), self.random.normal(0, 1e9, self.beams)]
        return kinds[self.random.integers(len(kinds))]


@pytest.mark.parametrize("seed", range(ROOMS))
def test_whatever_lasers_deliver_what_is_told_agrees(seed: int) -> None:
    random = np.random.default_rng(seed)
    lasers, scene = any_lasers(random), SCENE if random.random() < 0.5 else Scene()
    estimator, listener, t = FloorEstimator(lasers, scene=scene), Listener(), float(random.choice([0.0, 1.7e9]))
    room = AnyRoom(len(lasers["laser 0"].sweep.angles), random)
    for k in range(SCANS):
        t += float(random.choice([0.0, 0.025, 0.1, 3.0], p=[0.02, 0.2, 0.77, 0.01]))
        for event in estimator.scan(str(random.choice(list(lasers))), t, room.ranges(k), room.lights()):
            listener.hear(event)
        listener.agrees(estimator.labels() + estimator.awaited())
        if k == RESTART:
            estimator = FloorEstimator.from_dict(json.loads(json.dumps(estimator.to_dict())), lasers, scene=scene)
