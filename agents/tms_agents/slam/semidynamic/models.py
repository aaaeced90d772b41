"""What the object database tells of tagged things and of the robot: shapes, places of tags, antennas."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tms_agents.slam.geometry import Floats
from tms_agents.slam.logs import LogError, parse_laser


@dataclass(frozen=True, slots=True, eq=False)
class ObjectModel:
    """``parts``: closed polygons (P, 2) m that a laser sees, in the object's frame; ``tag`` (3,): where the tag is
    and the outward normal of its face. The origin of what is ``hinged`` (a door) is its hinge, +x along the panel."""

    kind: str
    parts: tuple[Floats, ...]
    tag: Floats

    @property
    def hinged(self) -> bool:
        return self.kind.startswith("door")

    @property
    def turned_alike(self) -> bool:
        """Whether a laser cannot tell how it is turned: every corner is equally far from the origin (ten and more)."""
        corners = np.concatenate(self.parts)
        radii = np.hypot(corners[:, 0], corners[:, 1])
        return len(corners) >= 10 and float(np.ptp(radii)) < 0.05 * float(radii.max())


@dataclass(frozen=True, slots=True, eq=False)
class Antenna:
    """``pose`` (3,) on the robot, +x along its beam; data sheet: reads so far (m), at ``half_beam`` (rad) half the
    power is left."""

    pose: Floats
    reach: float
    half_beam: float


@dataclass(frozen=True, slots=True, eq=False)
class Models:
    """``laser`` (3,) on the robot; antennas by number; objects by tag."""

    laser: Floats
    antennas: Mapping[int, Antenna]
    objects: Mapping[str, ObjectModel]


def parse_models(text: str) -> Models:
    """A ``models.json``: ``robot`` with ``laser_pose`` and ``antennas``, ``tags`` with ``class``, ``tag_pose`` and
    ``parts``.

    Raises:
        LogError: it is not one; the text says what is missing.
    """
    laser = parse_laser(text)
    document = json.loads(text)
    try:
        antennas = {int(one["id"]): _antenna(one) for one in document["robot"]["antennas"]}
        objects = {str(tag): _object(one) for tag, one in document["tags"].items()}
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise LogError(f"models.json: no usable antennas and tags ({type(error).__name__}: {error})") from error
    return Models(laser, antennas, objects)


def _antenna(one: Mapping[str, Any]) -> Antenna:
    reach, half_beam = float(one["nominal_max_range"]), float(one["nominal_half_beam"])
    if not (0 < reach < 50 and 0 < half_beam <= np.pi):
        raise ValueError("an antenna's range or beam is impossible")
    return Antenna(_pose(one["pose"]), reach, half_beam)


def _object(one: Mapping[str, Any]) -> ObjectModel:
    parts = tuple(np.asarray(part, dtype=np.float64) for part in one["parts"])
    if not parts or any(part.ndim != 2 or part.shape[1] != 2 or len(part) < 2 for part in parts):
        raise ValueError("parts are no polygons")
    if not all(np.isfinite(part).all() for part in parts):
        raise ValueError("parts are not finite")
    return ObjectModel(str(one["class"]), parts, _pose(one["tag_pose"]))


def _pose(values: Any) -> Floats:
    pose: Floats = np.asarray(values, dtype=np.float64)
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise ValueError(f"{values} is no pose")
    return pose
