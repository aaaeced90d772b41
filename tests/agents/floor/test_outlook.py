"""A region that a laser cannot see: everything would work, and nothing would ever be told. It is said."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from floor_rig import DEPTH, WIDTH, Room, config_toml, laser_toml, sweep

from tms_agents.clocks import Clocks
from tms_agents.config import read_config
from tms_agents.devices.scans import Scan
from tms_agents.devices.transport import DeviceState
from tms_agents.floor.config import FloorConfig
from tms_agents.floor.core import Floor

SOUTH = (2.5, 0.05, math.pi / 2)
THE_ROOM = [[0, 0], [WIDTH, 0], [WIDTH, DEPTH], [0, DEPTH]]


def states(tmp_path, region, scan, given=SOUTH, seconds=4.0, more=""):
    """What is said of the laser while it delivers the scans that ``scan`` makes of the time."""
    path = tmp_path / "floor.toml"
    scene = f"[scene]\nregion = {region}\n{more}"
    laser = laser_toml('{ kind = "scip", host = "h" }', given)
    path.write_text(config_toml("lab", "http://127.0.0.1:1", laser, more=scene))
    now, numbers, found = [1000.0], itertools.count(1), []
    clocks = Clocks(lambda: now[0], lambda: now[0])
    floor = Floor(read_config(path, FloorConfig), {}, clocks, lambda: f"lab-floor/{next(numbers)}")
    floor.line("laser", DeviceState("connected", "test"))
    for n in range(round(seconds * 10)):
        now[0] += 0.1
        floor.scans("laser", now[0], [scan(n / 10)])
        found.append(floor.states()["laser laser"])
    return found


def seen(beams=None, pose=SOUTH):
    room, beams = Room(), beams or sweep()
    return lambda t: Scan(beams, room.ranges(beams, pose))


ELSEWHERE = "laser: it sees nothing of the region: is its pose right, and [scene] region?"


@pytest.mark.parametrize(
    ("region", "given"),
    [
        ([[60, 40], [65, 40], [65, 44], [60, 44]], SOUTH),  # another frame
        ([[0, 4.2], [5, 4.2], [5, 7.5], [0, 7.5]], SOUTH),  # the room behind the wall, within the reach
        (THE_ROOM, (2.5, 0.05, -math.pi / 2)),  # it seems to look at the wall behind it
        (THE_ROOM, (2.5, -9.0, math.pi / 2)),  # farther than it reaches
        ([[60, 40], [75, 50.01], [60, 40.01]], SOUTH),  # narrow
    ],
)
def test_a_region_that_is_not_seen_is_said(tmp_path, region, given):
    found = states(tmp_path, region, seen(), given)
    assert found[5].state == "connected", "not at once: something may be before it"
    assert {(one.state, one.why) for one in found[25:]} == {("faulty", ELSEWHERE)}


HALF_ROUND = sweep()
ALL_ROUND = sweep(beams=721, span=2 * math.pi - 2 * math.pi / 721)


@pytest.mark.parametrize(
    ("region", "scan", "given", "more"),
    [
        (THE_ROOM, seen(), SOUTH, ""),
        ([[2, 1], [3, 1], [3, 1.1], [2, 1.1]], seen(), SOUTH, ""),  # a strip of the room
        (THE_ROOM, seen(ALL_ROUND, (2.5, 2.0, 3.0)), (2.5, 2.0, 3.0), ""),
        # Where its first and its last beam meet.
        ([[4.6, 1.7], [5, 1.7], [5, 2.3], [4.6, 2.3]], seen(ALL_ROUND, (2.5, 2.0, math.pi)), (2.5, 2.0, math.pi), ""),
        # A hall in which nothing is near enough for an echo.
        (THE_ROOM, lambda t: Scan(HALF_ROUND, np.full(361, np.inf)), SOUTH, ""),
        # Seen in a mirror only.
        ([[0, 4.2], [5, 4.2], [5, 7.5], [0, 7.5]], seen(), SOUTH, "mirrors = [[[0, 0], [0, 4]]]\n"),
    ],
)
def test_a_region_of_which_something_is_seen(tmp_path, region, scan, given, more):
    # In the hall the same scan comes again and again, which is not strange there.
    assert {one.state for one in states(tmp_path, region, scan, given, more=more)} == {"connected"}


def test_what_stood_before_it_goes_away(tmp_path):
    """It is said for as long as nothing of the region is seen; what stands there later is another thing."""
    beams, room = sweep(), Room()

    def scan(t):
        ranges = room.ranges(beams, SOUTH)
        blocked = t < 4.0 or t > 5.0
        return Scan(beams, np.minimum(ranges, 0.2 + 0.01 * room.ranges(beams, SOUTH)) if blocked else ranges)

    found = states(tmp_path, [[0, 1], [5, 1], [5, 4], [0, 4]], scan, seconds=9.0)
    assert found[39].state == "faulty"
    assert {one.state for one in found[41:]} == {"connected"}
