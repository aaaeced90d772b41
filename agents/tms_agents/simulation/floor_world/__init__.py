"""A simulated floor: people walk, things are put down and picked up, lasers just above the floor look at it.

    world = FloorWorld("three", seed=7, feet="prints")
    for frame in world.scans():          # raw sweeps as a driver delivers them
        estimator.scan(frame.sensor, frame.t, frame.ranges, frame.intensities)
    truth = world.truth()                # for scores only, never for an estimator

Seeds below 1000 are for tuning; seeds from 1000 on are unseen: look at them for reports only, and never tune to them.
``feet``: "legs" is a plane at the height of ankles, "prints" one 16 mm above the floor, where a shoe is seen only while
it stands. A seed gives the same room and, until somebody steps on another foot, the same life for both.

``LiveRoom`` is the same room without the scripted life, for demonstrations: tell it where people, things and robots are
(`move_people`, `things`, `robots`) and ask for sweeps (`scan`). Walls, furniture and lasers can be drawn (`furnish`) or
given. Nothing in here imports an estimator.
"""

import tms_agents.compiled  # noqa: F401, before there are kernels
from tms_agents.simulation.floor_world.furnishing import Home, Setting, furnish
from tms_agents.simulation.floor_world.lasers import COARSE, FINE, LASERS, Laser, Mount, NoiseParameters
from tms_agents.simulation.floor_world.room import Furniture, LiveRoom, Robot, Thing, Wall
from tms_agents.simulation.floor_world.scenarios import SCENARIOS, Scenario
from tms_agents.simulation.floor_world.world import FloorWorld, Frame, Known, write

#: Seeds from here on are for reports only.
UNSEEN = 1000

__all__ = [
    "COARSE",
    "FINE",
    "LASERS",
    "SCENARIOS",
    "UNSEEN",
    "FloorWorld",
    "Frame",
    "Furniture",
    "Home",
    "Known",
    "Laser",
    "LiveRoom",
    "Mount",
    "NoiseParameters",
    "Robot",
    "Scenario",
    "Setting",
    "Thing",
    "Wall",
    "furnish",
    "write",
]
