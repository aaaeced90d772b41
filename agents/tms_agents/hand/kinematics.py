"""Forward kinematics of a serial arm: joint states in, pose of the gripper and its uncertainty out.

An arm comes from a URDF file (``urdf``) or a table of Denavit-Hartenberg parameters (``dh_arm``). Metres and radians;
a transform is a 4x4 homogeneous matrix that takes points of the inner frame to the outer one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


class KinematicsError(ValueError):
    """The description of an arm cannot be used, or a joint's state is missing; one line that says why."""


@dataclass(frozen=True, slots=True)
class Drive:
    """What moves a segment: ``joint`` * ``factor`` + ``offset``, about or along a unit ``axis`` (inner frame)."""

    joint: str
    kind: Literal["turns", "slides"]
    axis: tuple[float, float, float]
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Segment:
    """One piece of an arm: what moves it (None: nothing) stands in frame ``before``, the next piece in ``after``."""

    before: Matrix
    drive: Drive | None = None
    after: Matrix | None = None


@dataclass(frozen=True)
class Gripper:
    """The gripper in the frame of the robot: its transform, and how each joint moves it (3 x joints, m per unit)."""

    pose: Matrix
    jacobian: Matrix

    @property
    def xyz(self) -> tuple[float, float, float]:
        x, y, z = self.pose[:3, 3]
        return float(x), float(y), float(z)


class Arm:
    """Segments from the robot's base to the gripper."""

    def __init__(self, segments: Sequence[Segment]) -> None:
        self.segments = tuple(segments)
        #: Joints whose state is needed, in order from the base.
        self.joints = tuple(dict.fromkeys(one.drive.joint for one in self.segments if one.drive))

    def gripper(self, states: Mapping[str, float]) -> Gripper:
        """``states``: radians or metres per joint; more joints than needed may be given.

        Raises:
            KinematicsError: a joint is missing.
        """
        pose = np.eye(4)
        moved: list[tuple[Drive, Matrix, Matrix]] = []
        for segment in self.segments:
            pose = pose @ segment.before
            if (drive := segment.drive) is not None:
                if drive.joint not in states:
                    raise KinematicsError(f"no state of joint {drive.joint!r}")
                axis = np.asarray(drive.axis)
                moved.append((drive, pose[:3, :3] @ axis, pose[:3, 3].copy()))
                value = states[drive.joint] * drive.factor + drive.offset
                pose = pose @ (rotation(axis, value) if drive.kind == "turns" else translation(axis * value))
            if segment.after is not None:
                pose = pose @ segment.after
        jacobian = np.zeros((3, len(self.joints)))
        for drive, axis, origin in moved:
            column = np.cross(axis, pose[:3, 3] - origin) if drive.kind == "turns" else axis
            jacobian[:, self.joints.index(drive.joint)] += drive.factor * column
        return Gripper(pose, jacobian)


def dh_arm(rows: Sequence[tuple[str | None, str, float, float, float, float]], base: Matrix, tool: Matrix) -> Arm:
    """An arm from standard (distal) Denavit-Hartenberg rows (joint, kind, a, alpha, d, theta).

    The transform of a row is Rz(theta) Tz(d) Tx(a) Rx(alpha), as in Spong, Robot Modeling and Control, 3.2. The state
    of a joint is added to theta where it ``turns``, to d where it ``slides``; joint None is a fixed piece. ``base`` is
    where the first row stands in the robot's frame, ``tool`` the gripper in the last one's.
    """
    z = (0.0, 0.0, 1.0)
    segments = [Segment(base)]
    for joint, kind, a, alpha, d, theta in rows:
        still = rotation(np.asarray(z), theta) @ translation(np.array([0.0, 0.0, d]))
        after = translation(np.array([a, 0.0, 0.0])) @ rotation(np.array([1.0, 0.0, 0.0]), alpha)
        # Turning about and sliding along z commute with what stands still there.
        drive = None if joint is None else Drive(joint, "turns" if kind == "turns" else "slides", z)
        segments.append(Segment(still, drive, after))
    return Arm([*segments, Segment(tool)])


def rotation(axis: Matrix, angle: float) -> Matrix:
    """Turn by ``angle`` about a unit ``axis`` (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    result = np.eye(4)
    result[:3, :3] += math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
    return result


def translation(by: Matrix) -> Matrix:
    result = np.eye(4)
    result[:3, 3] = by
    return result


def from_xyz_rpy(xyz: Sequence[float], rpy: Sequence[float]) -> Matrix:
    """Translation, then roll, pitch, yaw about the fixed axes x, y, z: the convention of URDF."""
    roll, pitch, yaw = rpy
    turned = rotation(np.array([0.0, 0.0, 1.0]), yaw) @ rotation(np.array([0.0, 1.0, 0.0]), pitch)
    return translation(np.asarray(xyz)) @ turned @ rotation(np.array([1.0, 0.0, 0.0]), roll)
