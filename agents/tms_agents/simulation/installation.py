"""The demo's agents as an installer sets them up: a configuration file for each, and the calibration of its board."""

from __future__ import annotations

import json
from pathlib import Path

from tms_agents.cabinet.calibration_file import write_calibration
from tms_agents.simulation.cabinet_bench import CabinetBench
from tms_agents.simulation.hardware import Hardware, Plugs
from tms_agents.simulation.robot_bench import GRIPPER, URDF
from tms_agents.simulation.room import (
    BED,
    FLOOR_AGENT,
    HAND_ZONE,
    LASER_POSE,
    ROBOT_AGENT,
    ROBOT_LANE,
    ROBOT_SIZE,
    SIZE,
)

BOARD = "shelf"
#: Weigh so long with the field off, then read the tags.
WEIGH_S = 0.6


def install(folder: Path, hardware: Hardware, url: str, room: str) -> dict[str, Path]:
    """Write everything into ``folder``; the configuration files by agent."""
    configs = {}
    for name, plugs in hardware.plugs.items():
        if name == ROBOT_AGENT:
            (folder / "robot.urdf").write_text(URDF)
            text = _hand(plugs)
        elif name == FLOOR_AGENT:
            text = _floor(plugs)
        else:
            bench = hardware.cabinets[name]
            write_calibration(folder / f"{name}.calibration.toml", {BOARD: bench.calibration()})
            text = _cabinet(bench, plugs)
        configs[name] = folder / f"{name}.toml"
        configs[name].write_text(_head(name, url, room) + text)
    return configs


def _head(agent: str, url: str, room: str) -> str:
    return f"""agent = {_text(agent)}
room = {_text(room)}

[server]
url = {_text(url)}
linger_s = 0.02

[spool]
path = {_text(agent + ".spool")}
"""


def _cabinet(bench: CabinetBench, plugs: Plugs) -> str:
    one = bench.cabinet
    x, y = one.corner
    cells = [[round(a, 4), round(b, 4)] for a, b in bench.cells]
    return f"""
[[boards]]
name = "{BOARD}"
load = {{ kind = "ros-tms", device = {_text(plugs.loads)} }}
width = {one.width}
depth = {one.depth}
cells = {cells}
pose = {{ x = {x}, y = {y}, theta = {one.theta:.6f}, z = {one.z} }}
surface = {_text(one.surface)}

[[readers]]
source = {{ kind = "tr3-serial", device = {_text(plugs.reader)}, poll_s = 0.1 }}
zone = {_text(one.id)}
weigh_s = {WEIGH_S}

[[zones]]
name = {_text(one.id)}
board = "{BOARD}"
"""


def _hand(plugs: Plugs) -> str:
    assert plugs.states is not None
    host, port = plugs.states
    return f"""
[robot]
states = {{ kind = "tcp", host = {_text(host)}, port = {port} }}

[[hands]]
name = "{GRIPPER}"
zone = "{HAND_ZONE}"
source = {{ kind = "tr3-serial", device = {_text(plugs.reader)} }}

[hands.arm]
urdf = "robot.urdf"
tip_link = "{GRIPPER}"

[hands.grasp]
place_m = 0.15                   # range of the reader in the gripper, and a little more
"""


def _floor(plugs: Plugs) -> str:
    assert plugs.laser is not None
    host, port = plugs.laser
    x, y, theta = LASER_POSE
    length, width = ROBOT_SIZE
    w, d = SIZE
    return f"""
[[lasers]]
source = {{ kind = "scip", host = {_text(host)}, port = {port} }}
pose = {{ x = {x}, y = {y}, theta = {theta} }}

[scene]
region = [[0.0, 0.0], [{w}, 0.0], [{w}, {d}], [0.0, {d}]]
seats = [{[list(one) for one in BED]}]
masks = [{[list(one) for one in ROBOT_LANE]}]         # the robot's lane: it reports itself

[[robots]]
width = {width}
length = {length}
"""


def _text(value: str | None) -> str:
    return json.dumps(value, ensure_ascii=False)
