"""The arm of a robot from its URDF file; meshes and everything else that does not move the gripper are left alone.

Follows https://wiki.ros.org/urdf/XML/joint: the axis is (1, 0, 0) where none is given, ``mimic`` joints follow theirs.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from tms_agents.hand.kinematics import Arm, Drive, KinematicsError, Segment, from_xyz_rpy

_KINDS = {"revolute": "turns", "continuous": "turns", "prismatic": "slides"}
_MAX_BYTES = 50_000_000


def read_urdf(path: Path, base: str | None, tip: str) -> Arm:
    """The chain of joints from link ``base`` (None: the root) to link ``tip``.

    Raises:
        KinematicsError: the file cannot be read, is no URDF, or has no such chain.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise KinematicsError(f"{path}: larger than {_MAX_BYTES} bytes")
        return parse_urdf(path.read_text(encoding="utf-8"), base, tip)
    except (OSError, UnicodeDecodeError) as error:
        raise KinematicsError(f"{path}: {error}") from error
    except KinematicsError as error:
        raise KinematicsError(f"{path}: {error}") from error


def parse_urdf(text: str, base: str | None, tip: str) -> Arm:
    """The same from the text of a file."""
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise KinematicsError(f"no XML: {error}") from error
    if robot.tag != "robot":
        raise KinematicsError(f"no URDF: the root element is {robot.tag!r}")
    if any("xacro" in element.tag for element in robot.iter()):
        raise KinematicsError("holds xacro macros; expand it first: xacro FILE > robot.urdf")
    links = {element.get("name", "") for element in robot.iterfind("link")}
    joints = {element.get("name", ""): element for element in robot.iterfind("joint")}
    above = {_link(joint, "child"): joint for joint in joints.values()}
    for name in (base, tip):
        if name is not None and name not in links:
            raise KinematicsError(f"no link {name!r}; there are {', '.join(sorted(links)[:20])}")
    chain: list[Segment] = []
    link = tip
    while link != base and link in above and len(chain) <= len(joints):
        chain.append(_segment(above[link], joints))
        link = _link(above[link], "parent")
    if (base is not None and link != base) or len(chain) > len(joints):
        raise KinematicsError(f"no chain of joints leads from link {base or 'root'!r} to {tip!r}")
    return Arm(chain[::-1])


def _segment(joint: Element, joints: dict[str, Element]) -> Segment:
    origin = joint.find("origin")
    xyz, rpy = (_numbers(origin, name, "0 0 0") for name in ("xyz", "rpy"))
    before = from_xyz_rpy(xyz, rpy)
    kind = joint.get("type", "")
    if kind == "fixed":
        return Segment(before)
    if kind not in _KINDS:
        raise KinematicsError(f"joint {joint.get('name')!r} of type {kind!r} in the arm")
    x, y, z = _numbers(joint.find("axis"), "xyz", "1 0 0")
    length = math.hypot(x, y, z)
    if length < 1e-9:
        raise KinematicsError(f"joint {joint.get('name')!r} has the axis 0 0 0")
    name, factor, offset = _driven_by(joint, joints)
    turns = _KINDS[kind] == "turns"
    return Segment(
        before, Drive(name, "turns" if turns else "slides", (x / length, y / length, z / length), factor, offset)
    )


def _driven_by(joint: Element, joints: dict[str, Element]) -> tuple[str, float, float]:
    """The joint whose state moves this one, with factor and offset: itself, or the one it mimics."""
    name, factor, offset = joint.get("name", ""), 1.0, 0.0
    for _ in range(len(joints)):
        mimic = joints[name].find("mimic")
        if mimic is None:
            return name, factor, offset
        (more,), (shift,) = (_numbers(mimic, key, zero) for key, zero in (("multiplier", "1"), ("offset", "0")))
        followed = mimic.get("joint", "")
        if followed not in joints:
            raise KinematicsError(f"joint {name!r} mimics {followed!r}, which is not there")
        name, factor, offset = followed, factor * more, factor * shift + offset
    raise KinematicsError(f"joint {joint.get('name')!r} mimics itself")


def _numbers(element: Element | None, key: str, default: str) -> list[float]:
    text = default if element is None else element.get(key, default)
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != len(default.split()) or not all(map(math.isfinite, values)):
        raise KinematicsError(f"{key}={text!r} should be {len(default.split())} numbers")
    return values


def _link(joint: Element, end: str) -> str:
    element = joint.find(end)
    if element is None or not element.get("link"):
        raise KinematicsError(f"joint {joint.get('name')!r} has no {end}")
    return element.get("link", "")
