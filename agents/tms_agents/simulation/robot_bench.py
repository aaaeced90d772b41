"""The devices of the simulated robot: the tag reader in its gripper, and its controller that tells joints and fingers.

The arm has a shoulder and an elbow that move the gripper in the vertical plane ahead of the robot.
"""

from __future__ import annotations

import json
import math

import numpy as np

from tms_agents.devices.tr3.emulator import Tr3Device
from tms_agents.simulation.world import World, Xy

GRIPPER = "gripper"
SHOULDER_M, LINK_M = 0.9, 0.5
OPEN_M, AROUND_A_THING_M = 0.1, 0.06
#: Metres per second at which a finger moves, from one message to the next: ``STATE_S``.
_FINGER_SPEED, STATE_S = 0.2, 0.05
_STILL = round(0.5 / STATE_S)
_MISS_RATE = 0.05
URDF = f"""<?xml version="1.0"?>
<robot name="demo">
  <link name="base_link"/>
  <link name="upper_arm"/>
  <link name="forearm"/>
  <link name="{GRIPPER}"/>
  <joint name="shoulder" type="revolute">
    <parent link="base_link"/><child link="upper_arm"/>
    <origin xyz="0 0 {SHOULDER_M}"/><axis xyz="0 1 0"/><limit lower="-3.1" upper="3.1"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper_arm"/><child link="forearm"/>
    <origin xyz="{LINK_M} 0 0"/><axis xyz="0 1 0"/><limit lower="-3.1" upper="3.1"/>
  </joint>
  <joint name="tool" type="fixed">
    <parent link="forearm"/><child link="{GRIPPER}"/>
    <origin xyz="{LINK_M} 0 0"/>
  </joint>
</robot>
"""


class RobotBench:
    """``reader`` and this itself (a line of JSON per tick) are put behind lines. All calls from one thread."""

    def __init__(self, robot: str, rng: np.random.Generator) -> None:
        self.reader = Tr3Device(antennas=2)
        self.reader.look = self._in_view
        self._robot, self._rng = robot, rng
        self._base = (0.0, 0.0, 0.0)
        self._joints = (0.0, 0.0)
        self._gripped: str | None = None
        self._opening_m = OPEN_M
        self._still = 0  # messages since the fingers moved

    def follow(self, world: World) -> None:
        """Robot, arm and gripper are as in the room."""
        robot = world.movers[self._robot]
        self._base = (*robot.xy, robot.theta)
        self._joints = joints_of(robot.hand)
        gripped = world.gripped_by(self._robot)
        if gripped != self._gripped:
            self._gripped, self._still = gripped, 0

    @property
    def is_firm(self) -> bool:
        """The fingers have stood still for long enough to be believed."""
        return self._still >= _STILL

    def tick(self) -> bytes:
        """What the controller says now."""
        goal, most = AROUND_A_THING_M if self._gripped else OPEN_M, _FINGER_SPEED * STATE_S
        moved = min(max(goal - self._opening_m, -most), most)
        self._opening_m += moved
        self._still = self._still + 1 if moved == 0.0 else 0
        x, y, theta = self._base
        shoulder, elbow = self._rng.normal(self._joints, 0.001)
        message = {
            "joints": {"shoulder": round(float(shoulder), 5), "elbow": round(float(elbow), 5)},
            "base": [round(x, 4), round(y, 4), round(theta, 4)],
            "gripper": {GRIPPER: {"opening_m": round(self._opening_m, 4)}},
        }
        return json.dumps(message).encode() + b"\n"

    def receive(self, data: bytes) -> bytes:
        """The controller only speaks."""
        return b""

    def _in_view(self, antenna: int) -> list[str]:
        reads = antenna == 0 and self._gripped is not None and self._rng.random() >= _MISS_RATE
        return [self._gripped] if reads and self._gripped is not None else []


def joints_of(hand: Xy) -> tuple[float, float]:
    """Shoulder and elbow (radians, downwards) for a gripper so far ahead and so high; the elbow points up.

    Raises:
        ValueError: the arm is too short.
    """
    ahead, up = hand[0], hand[1] - SHOULDER_M
    distance = math.hypot(ahead, up)
    if distance > 2 * LINK_M:
        raise ValueError(f"the arm does not reach {hand}")
    bend = math.acos(distance / (2 * LINK_M))
    shoulder = -(math.atan2(up, ahead) + bend)
    return shoulder, 2 * bend
