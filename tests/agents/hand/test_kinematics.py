"""Forward kinematics against arms computed by hand and against the same arm described in the other way."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.hand.kinematics import KinematicsError, dh_arm, from_xyz_rpy
from tms_agents.hand.urdf import parse_urdf, read_urdf

EYE = np.eye(4)
ANGLE = st.floats(-3.0, 3.0)
LENGTH = st.floats(-1.5, 1.5)


def urdf(*joints: str, links: int | None = None) -> str:
    count = len(joints) + 1 if links is None else links
    names = "".join(f'<link name="l{n}"><visual><geometry><mesh filename="x.stl"/></geometry></visual></link>'
                    for n in range(count))  # fmt: skip
    return f'<?xml version="1.0"?><robot name="r">{names}{"".join(joints)}</robot>'


def joint(n: int, kind: str, inside: str = "", *, name: str = "") -> str:
    ends = f'<parent link="l{n}"/><child link="l{n + 1}"/>'
    return f'<joint name="{name or f"j{n}"}" type="{kind}">{ends}{inside}</joint>'


def test_a_planar_arm_of_two_links():
    """x = a cos q1 + b cos(q1 + q2), y likewise with sin: school geometry."""
    arm = dh_arm([("s", "turns", 0.4, 0, 0, 0), ("e", "turns", 0.3, 0, 0, 0)], EYE, EYE)
    q1, q2 = 0.7, -1.1
    expected = (0.4 * math.cos(q1) + 0.3 * math.cos(q1 + q2), 0.4 * math.sin(q1) + 0.3 * math.sin(q1 + q2), 0)
    assert arm.gripper({"s": q1, "e": q2}).xyz == pytest.approx(expected)
    assert arm.joints == ("s", "e")


def test_a_scara_from_urdf():
    """A column that slides, two links that turn about z, a gripper 0.1 m below."""
    text = urdf(
        joint(0, "prismatic", '<origin xyz="0.1 0 0.5"/><axis xyz="0 0 2"/>', name="lift"),
        joint(1, "revolute", '<axis xyz="0 0 1"/>', name="shoulder"),
        joint(2, "continuous", '<origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>', name="elbow"),
        joint(3, "fixed", '<origin xyz="0.3 0 -0.1"/>'),
    )
    arm = parse_urdf(text, None, "l4")
    found = arm.gripper({"lift": 0.2, "shoulder": math.pi / 2, "elbow": math.pi / 2, "wheel": 9.0})
    assert found.xyz == pytest.approx((0.1 - 0.3, 0.4, 0.6))


def test_the_axis_is_x_where_none_is_given_and_rpy_is_about_fixed_axes():
    arm = parse_urdf(urdf(joint(0, "revolute"), joint(1, "fixed", '<origin xyz="0 1 0"/>')), None, "l2")
    assert arm.gripper({"j0": math.pi / 2}).xyz == pytest.approx((0, 0, 1))
    # First roll: z -> -y; then yaw: -y -> x.
    turned = from_xyz_rpy((0, 0, 0), (math.pi / 2, 0, math.pi / 2)) @ np.array([0, 0, 1, 1])
    assert turned[:3] == pytest.approx((1, 0, 0))


def test_a_mimic_joint_follows():
    fingers = '<axis xyz="0 0 1"/><mimic joint="j0" multiplier="-2" offset="0.5"/>'
    text = urdf(joint(0, "revolute", '<axis xyz="0 0 1"/>'), joint(1, "revolute", fingers), joint(2, "fixed"))
    arm = parse_urdf(text, "l0", "l3")
    assert arm.joints == ("j0",)
    heading = math.atan2(*arm.gripper({"j0": 0.3}).pose[[1, 0], 0])
    assert heading == pytest.approx(0.3 - 2 * 0.3 + 0.5)


def test_a_chain_between_two_links_leaves_the_rest_out():
    text = urdf(*(joint(n, "fixed", '<origin xyz="1 0 0"/>') for n in range(4)))
    assert parse_urdf(text, "l1", "l3").gripper({}).xyz == (2, 0, 0)


@st.composite
def tables(draw: st.DrawFn) -> list[tuple[str | None, str, float, float, float, float]]:
    rows = draw(st.lists(st.tuples(st.sampled_from(["turns", "slides", "still"]), LENGTH, ANGLE, LENGTH, ANGLE),
                         min_size=1, max_size=7))  # fmt: skip
    return [
        (None if kind == "still" else f"q{n}", "turns" if kind == "still" else kind, a, alpha, d, theta)
        for n, (kind, a, alpha, d, theta) in enumerate(rows)
    ]


def as_urdf(rows) -> str:
    """The arm of a DH table: joint n turns about z of the frame before it, its offsets stand in fixed joints."""
    joints, n = [], 0
    for name, kind, a, alpha, d, theta in rows:
        joints.append(joint(n, "fixed", f'<origin xyz="0 0 {d!r}" rpy="0 0 {theta!r}"/>', name=f"f{n}"))
        if name is not None:
            n += 1
            joints.append(
                joint(n, {"turns": "revolute", "slides": "prismatic"}[kind], '<axis xyz="0 0 1"/>', name=name)
            )
        n += 1
        joints.append(joint(n, "fixed", f'<origin xyz="{a!r} 0 0" rpy="{alpha!r} 0 0"/>', name=f"g{n}"))
        n += 1
    return urdf(*joints)


def by_quaternions(rows, states) -> np.ndarray:
    """Where the gripper is, with quaternions instead of matrices."""

    def times(p, q):
        w, v = p[0] * q[0] - p[1:] @ q[1:], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
        return np.array([w, *v])

    def turn(axis, angle):
        return np.array([math.cos(angle / 2), *(math.sin(angle / 2) * np.asarray(axis, float))])

    def point(q, v):
        return times(times(q, np.array([0.0, *v])), q * [1, -1, -1, -1])[1:]

    heading, place = np.array([1.0, 0, 0, 0]), np.zeros(3)
    for name, kind, a, alpha, d, theta in rows:
        value = states.get(name, 0.0)
        heading_z = times(heading, turn((0, 0, 1), theta + (value if kind == "turns" else 0)))
        place = place + point(heading, (0, 0, d + (value if kind == "slides" else 0))) + point(heading_z, (a, 0, 0))
        heading = times(heading_z, turn((1, 0, 0), alpha))
    return place


@given(tables(), st.lists(ANGLE, min_size=7, max_size=7))
def test_a_table_its_urdf_and_quaternions_agree(rows, values):
    states = {row[0]: value for row, value in zip(rows, values, strict=False) if row[0] is not None}
    table = dh_arm(rows, EYE, EYE)
    arm = parse_urdf(as_urdf(rows), None, f"l{as_urdf(rows).count('<joint')}")
    assert np.allclose(table.gripper(states).pose, arm.gripper(states).pose, atol=1e-9)
    assert np.allclose(table.gripper(states).xyz, by_quaternions(rows, states), atol=1e-9)


@given(tables(), st.lists(ANGLE, min_size=7, max_size=7))
def test_the_jacobian_is_the_derivative(rows, values):
    arm = dh_arm(rows, EYE, EYE)
    states = dict(zip(arm.joints, values, strict=False))
    found, step = arm.gripper(states), 1e-6
    for column, name in enumerate(arm.joints):
        up, down = (np.array(arm.gripper(states | {name: states[name] + s}).xyz) for s in (step, -step))
        assert np.allclose((up - down) / (2 * step), found.jacobian[:, column], atol=1e-5)


@pytest.mark.parametrize(
    ("text", "tip", "says"),
    [
        ("<robot", "l1", "no XML"),
        ("<sdf/>", "l1", "root element is 'sdf'"),
        (urdf(joint(0, "fixed")), "hand", "no link 'hand'"),
        (urdf(joint(0, "floating")), "l1", "type 'floating'"),
        (urdf(joint(0, "revolute", '<axis xyz="0 0 0"/>')), "l1", "axis 0 0 0"),
        (urdf(joint(0, "revolute", '<axis xyz="0 0"/>')), "l1", "should be 3 numbers"),
        (urdf(joint(0, "fixed", '<origin xyz="a b c"/>')), "l1", "should be 3 numbers"),
        (urdf(joint(0, "revolute", '<mimic joint="nobody"/>')), "l1", "not there"),
        (urdf(joint(0, "revolute", '<mimic joint="j0"/>')), "l1", "mimics itself"),
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro/></robot>', "l1", "expand it first"),
        ('<robot><link name="l1"/><joint name="j" type="fixed"><child link="l1"/></joint></robot>', "l1", "no parent"),
    ],
)
def test_what_cannot_be_used_is_said(text, tip, says):
    with pytest.raises(KinematicsError, match=says):
        parse_urdf(text, None, tip)


def test_no_chain_and_loops_are_said():
    text = urdf(joint(0, "fixed"), links=3)
    with pytest.raises(KinematicsError, match="no chain"):
        parse_urdf(text, "l2", "l1")
    loop = urdf(
        joint(0, "fixed"), '<joint name="k" type="fixed"><parent link="l1"/><child link="l0"/></joint>', links=2
    )
    with pytest.raises(KinematicsError, match="no chain"):
        parse_urdf(loop, None, "l1")


def test_a_missing_joint_and_file_are_said(tmp_path: Path):
    with pytest.raises(KinematicsError, match="no state of joint 's'"):
        dh_arm([("s", "turns", 1, 0, 0, 0)], EYE, EYE).gripper({"e": 1})
    with pytest.raises(KinematicsError, match=r"absent\.urdf"):
        read_urdf(tmp_path / "absent.urdf", None, "l1")


@given(st.text(max_size=200))
def test_any_text_is_an_arm_or_an_error(text):
    with pytest.raises(KinematicsError):
        parse_urdf(text, None, "tip")
