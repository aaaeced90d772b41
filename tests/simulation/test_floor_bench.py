"""The laser of the simulated room sees what is in the room, and its agent is set up to understand it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tms_agents.config import read_config
from tms_agents.floor.config import FloorConfig
from tms_agents.simulation.floor_bench import FloorBench
from tms_agents.simulation.hardware import plugged_in
from tms_agents.simulation.installation import install
from tms_agents.simulation.player import STEP_S
from tms_agents.simulation.room import FLOOR_AGENT, LASER_POSE, PERSON, SPOTS, new_world
from tms_agents.simulation.story import DROPPED
from tms_agents.simulation.world import OnFloor, World, Xy


class Time:
    """Seconds that pass when they are told to."""

    def __init__(self) -> None:
        self.s = 100.0

    def __call__(self) -> float:
        return self.s


def looked(bench: FloorBench, time: Time, scans: int = 20) -> np.ndarray:
    """Where the beams of the next scans end, in the room: (scans, beams, 2)."""
    found = []
    x, y, theta = LASER_POSE
    angles = bench.device.sweep.angles + theta
    for _ in range(scans):
        time.s += 0.025
        ranges, _ = bench.scan()
        found.append(np.stack([x + ranges * np.cos(angles), y + ranges * np.sin(angles)], axis=1))
    return np.array(found)


def near(points: np.ndarray, xy: Xy, metres: float) -> int:
    """Beams per scan that end there."""
    with np.errstate(invalid="ignore"):
        return round(float(np.mean(np.sum(np.hypot(*(points - xy).transpose(2, 0, 1)) < metres, axis=1))))


def room() -> tuple[FloorBench, Time, World]:
    time = Time()
    bench, world = FloorBench(np.random.default_rng(3), time), new_world()
    bench.follow(world)
    return bench, time, world


def test_a_thing_and_a_person_are_seen_where_they_are_and_on_the_bed_nobody() -> None:
    bench, time, world = room()
    empty = looked(bench, time)
    assert near(empty, SPOTS["bed"], 0.3) == near(empty, DROPPED, 0.1) == near(empty, SPOTS["middle"], 0.3) == 0
    world.movers[PERSON].xy = SPOTS["middle"]
    tag = world.tag_of(3)
    world.places[tag] = OnFloor(DROPPED)
    bench.follow(world)
    looked(bench, time, 120)  # the feet come after the body
    seen = looked(bench, time)
    assert near(seen, DROPPED, 0.06) >= 3, "a thing of 7 cm at 3 m"
    assert near(seen, SPOTS["middle"], 0.35) >= 6, "two legs"
    world.movers[PERSON].xy = SPOTS["bed"]
    bench.follow(world)
    time.s += 1.0
    assert near(looked(bench, time), SPOTS["bed"], 0.4) == 0


def test_somebody_walks_evenly_between_the_steps_of_the_world() -> None:
    bench, time, world = room()
    world.movers[PERSON].xy = SPOTS["bedside"]
    for _ in range(2):
        time.s += STEP_S
        bench.follow(world)
    world.movers[PERSON].walk([SPOTS["middle"]])
    middles, begun = [], time.s
    while world.movers[PERSON].path:
        world.step(STEP_S)
        bench.follow(world)
        for _ in range(4):
            time.s += STEP_S / 4
            bench.scan()
            middles.append(bench._room.people[PERSON].xy)
    steps = np.hypot(*np.diff(middles, axis=0).T)
    assert 0.8 < (time.s - begun) * 1.0 / math.dist(SPOTS["bedside"], SPOTS["middle"]) < 1.3
    assert steps.max() < 0.03 and steps[8:-8].min() > 0.015, "25 mm per sweep at 1 m/s"


def test_the_agent_of_the_laser_is_told_what_is_so(tmp_path: Path) -> None:
    with plugged_in(0, laser=True) as hardware:
        configs = install(tmp_path, hardware, "http://127.0.0.1:1", "demo")
        config = read_config(configs[FLOOR_AGENT], FloorConfig)
        assert hardware.plugs[FLOOR_AGENT].laser == (config.lasers[0].source.host, config.lasers[0].source.port)
    assert config.lasers[0].pose.pose == LASER_POSE
    assert len(config.room_scene().seats) == len(config.room_scene().masks) == len(config.room_scene().robots) == 1
    with plugged_in(0) as hardware:
        assert FLOOR_AGENT not in install(tmp_path, hardware, "http://127.0.0.1:1", "demo")
