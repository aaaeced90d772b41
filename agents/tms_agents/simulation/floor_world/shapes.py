"""What stands in the scan plane: line segments and circles, each with an owner, a velocity and how well it echoes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Xy = tuple[float, float]
Pose = tuple[float, float, float]

#: Owner of what is nobody's: walls and furniture.
NOBODY = -1


@dataclass(frozen=True, slots=True)
class Material:
    """``reflectivity`` 0..1 gives the light that comes back; ``echo`` is the probability that a beam echoes at all.

    A mirror gives no echo of its own: it shows the room in front of it.
    """

    reflectivity: float = 0.6
    echo: float = 1.0
    mirror: bool = False


PLAIN = Material()
#: A black or glossy thing nearly never echoes.
BLACK = Material(reflectivity=0.04, echo=0.08)
MIRROR = Material(reflectivity=0.9, echo=0.0, mirror=True)


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """``segments`` (n, 6): x0 y0 x1 y1 vx vy; ``circles`` (m, 5): x y radius vx vy; metres and metres per second.

    ``*_owner`` int64 and ``*_material`` (k, 3): reflectivity, probability of an echo, 1 for a mirror.
    """

    segments: Floats
    segment_owner: Ints
    segment_material: Floats
    circles: Floats
    circle_owner: Ints
    circle_material: Floats


@dataclass(slots=True)
class Drawing:
    """Collects shapes one by one."""

    _segments: list[tuple[float, ...]] = field(default_factory=list)
    _segment_owner: list[int] = field(default_factory=list)
    _segment_material: list[tuple[float, float, float]] = field(default_factory=list)
    _circles: list[tuple[float, ...]] = field(default_factory=list)
    _circle_owner: list[int] = field(default_factory=list)
    _circle_material: list[tuple[float, float, float]] = field(default_factory=list)

    def segment(self, a: Xy, b: Xy, owner: int = NOBODY, material: Material = PLAIN, velocity: Xy = (0.0, 0.0)) -> None:
        self._segments.append((*a, *b, *velocity))
        self._segment_owner.append(owner)
        self._segment_material.append((material.reflectivity, material.echo, float(material.mirror)))

    def circle(
        self, centre: Xy, radius: float, owner: int = NOBODY, material: Material = PLAIN, velocity: Xy = (0.0, 0.0)
    ) -> None:
        self._circles.append((*centre, radius, *velocity))
        self._circle_owner.append(owner)
        self._circle_material.append((material.reflectivity, material.echo, float(material.mirror)))

    def polygon(
        self, corners: list[Xy], owner: int = NOBODY, material: Material = PLAIN, velocity: Xy = (0.0, 0.0)
    ) -> None:
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            self.segment(a, b, owner, material, velocity)

    def box(
        self,
        pose: Pose,
        length: float,
        width: float,
        owner: int = NOBODY,
        material: Material = PLAIN,
        velocity: Xy = (0.0, 0.0),
    ) -> None:
        """A rectangle, ``length`` along the pose's x axis."""
        self.polygon(box_corners(pose, length, width), owner, material, velocity)

    def legs(self, pose: Pose, length: float, width: float, radius: float, material: Material = PLAIN) -> None:
        """Four round legs in the corners of a table, a bed or a chair."""
        for corner in box_corners(pose, length - 2 * radius, width - 2 * radius):
            self.circle(corner, radius, NOBODY, material)

    def capsule(
        self, a: Xy, radius_a: float, b: Xy, radius_b: float, owner: int, material: Material, velocity: Xy
    ) -> None:
        """Two circles and the tangents between them: the sole of a shoe from heel ``a`` to ball ``b``."""
        self.circle(a, radius_a, owner, material, velocity)
        self.circle(b, radius_b, owner, material, velocity)
        apart = math.dist(a, b)
        along = math.atan2(b[1] - a[1], b[0] - a[0])
        lean = math.acos(max(-1.0, min(1.0, (radius_a - radius_b) / apart)))
        for side in (along + lean, along - lean):
            c, s = math.cos(side), math.sin(side)
            self.segment(
                (a[0] + radius_a * c, a[1] + radius_a * s),
                (b[0] + radius_b * c, b[1] + radius_b * s),
                owner,
                material,
                velocity,
            )

    def shapes(self) -> Shapes:
        return Shapes(
            np.array(self._segments, dtype=np.float64).reshape(-1, 6),
            np.array(self._segment_owner, dtype=np.int64),
            np.array(self._segment_material, dtype=np.float64).reshape(-1, 3),
            np.array(self._circles, dtype=np.float64).reshape(-1, 5),
            np.array(self._circle_owner, dtype=np.int64),
            np.array(self._circle_material, dtype=np.float64).reshape(-1, 3),
        )


def box_corners(pose: Pose, length: float, width: float) -> list[Xy]:
    """Corners of a rectangle around ``pose``, counter-clockwise."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return [
        (pose[0] + c * u - s * v, pose[1] + s * u + c * v)
        for u, v in (
            (-length / 2, -width / 2),
            (length / 2, -width / 2),
            (length / 2, width / 2),
            (-length / 2, width / 2),
        )
    ]


def to_box(points: Floats, pose: Pose, width: float, depth: float) -> Floats:
    """Distance of points (..., 2) to a rectangle, 0 inside."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = points[..., 0] - pose[0], points[..., 1] - pose[1]
    u, v = np.abs(c * dx + s * dy) - width / 2, np.abs(c * dy - s * dx) - depth / 2
    return np.hypot(np.maximum(u, 0), np.maximum(v, 0))
