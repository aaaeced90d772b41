"""Where a robot's grippers are in the room: base pose and joint states, with their uncertainty."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass

from tms_agents.hand.events import Spot
from tms_agents.hand.kinematics import Arm, KinematicsError
from tms_agents.hand.states import GripperMessage, StateMessage

log = logging.getLogger(__name__)

#: A gripper whose place on the robot nobody tells is within an arm's length of the base: standard deviation, m.
_REACH_SD_M = 0.4
#: Nothing in a room is farther away: a joint state or a mimic factor that is nonsense.
_MOST_M = 1e5


@dataclass(frozen=True, kw_only=True, slots=True)
class Uncertainty:
    """Standard deviations: the base (m, rad) where the robot tells none, each joint (rad or m), all the rest (m)."""

    base_m: float = 0.05
    base_rad: float = 0.02
    joint: float = 0.005
    gripper_m: float = 0.01


class Posture:
    """Pure. Keeps the last base pose and joint states; ``base_z`` is the height of the robot's frame above the floor.

    ``base`` is for a robot that stands still and tells none.
    """

    def __init__(
        self,
        arms: Mapping[str, Arm | None],
        *,
        base: tuple[float, float, float] | None = None,
        base_z: float = 0.0,
        uncertainty: Uncertainty | None = None,
    ) -> None:
        self._arms, self._base_z, self._sd = dict(arms), base_z, uncertainty or Uncertainty()
        self.base = base
        self._base_sd = (self._sd.base_m, self._sd.base_rad) if base is None else (0.0, 0.0)
        self._joints: dict[str, float] = {}
        self._wanted = {name for arm in arms.values() if arm is not None for name in arm.joints}
        self._said: set[str] = set()

    def update(self, message: StateMessage) -> None:
        self._joints.update((name, value) for name, value in message.joints.items() if name in self._wanted)
        if message.base is not None:
            self.base = message.base
            self._base_sd = message.base_sd or (self._sd.base_m, self._sd.base_rad)

    def spot(self, hand: str, message: GripperMessage | None) -> Spot | None:
        """Where the gripper is; None while that cannot be told (which is logged once)."""
        if self.base is None:
            self._say_once(hand, "no pose of the base")
            return None
        arm = self._arms[hand]
        variance = self._sd.gripper_m**2
        if message is not None and message.position is not None:
            xyz, own = message.position, (variance, 0.0, variance)
        elif arm is None:
            far = _REACH_SD_M**2
            return self._in_room((0.0, 0.0, None), (far, 0.0, far))
        else:
            try:
                gripper = arm.gripper(self._joints)
            except KinematicsError as error:
                self._say_once(hand, str(error))
                return None
            xyz = gripper.xyz
            jx, jy = gripper.jacobian[0], gripper.jacobian[1]
            joint = self._sd.joint**2
            own = (
                float(jx @ jx) * joint + variance,
                float(jx @ jy) * joint,
                float(jy @ jy) * joint + variance,
            )
        spot = self._in_room(xyz, own)
        if not all(abs(one) < _MOST_M for one in (*spot.xy, spot.z or 0.0, *(spot.cov or ()))):  # NaN too
            self._say_once(hand, f"its joints put it at {spot.xy}")
            return None
        self._said.discard(hand)
        return spot

    def _in_room(self, xyz: tuple[float, float, float | None], own: tuple[float, float, float]) -> Spot:
        """``own``: covariance (xx, xy, yy) of the gripper's place on the robot, in the frame of the robot."""
        assert self.base is not None
        bx, by, theta = self.base
        cos, sin = math.cos(theta), math.sin(theta)
        x, y, z = xyz
        dx, dy = cos * x - sin * y, sin * x + cos * y
        xx, xy, yy = own
        place, turn = self._base_sd[0] ** 2, self._base_sd[1] ** 2
        cov = (
            cos * cos * xx - 2 * sin * cos * xy + sin * sin * yy + place + turn * dy * dy,
            sin * cos * (xx - yy) + (cos * cos - sin * sin) * xy - turn * dx * dy,
            sin * sin * xx + 2 * sin * cos * xy + cos * cos * yy + place + turn * dx * dx,
        )
        return Spot((bx + dx, by + dy), None if z is None else z + self._base_z, cov)

    def _say_once(self, hand: str, why: str) -> None:
        if hand not in self._said:
            self._said.add(hand)
            log.warning("where the %s hand is is not known: %s", hand, why)
