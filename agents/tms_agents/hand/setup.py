"""From the configuration to a robot: arms, settings, surfaces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tms_agents.hand.config import ArmSection, GraspSection, HandConfig
from tms_agents.hand.evidence import ReadModel
from tms_agents.hand.fingers import FingerSettings
from tms_agents.hand.kinematics import Arm, KinematicsError, Segment, dh_arm, from_xyz_rpy
from tms_agents.hand.posture import Posture, Uncertainty
from tms_agents.hand.robot import Robot
from tms_agents.hand.settings import GraspSettings
from tms_agents.hand.surfaces import Surfaces
from tms_agents.hand.urdf import read_urdf
from tms_client.cli import CommandError
from tms_schemas.rooms import Room


def make_robot(config: HandConfig, new_label: Callable[[], str]) -> Robot:
    """
    Raises:
        CommandError: the description of an arm cannot be used.
    """
    assert config.robot is not None
    robot = config.robot
    try:
        arms = {hand.name: None if hand.arm is None else make_arm(hand.arm) for hand in config.hands}
    except KinematicsError as error:
        raise CommandError(str(error)) from error
    posture = Posture(
        arms,
        base=robot.base,
        base_z=robot.base_z,
        uncertainty=Uncertainty(
            base_m=robot.base_sd_m, base_rad=robot.base_sd_rad, joint=robot.joint_sd, gripper_m=robot.gripper_sd_m
        ),
    )
    hands = {hand.name: make_settings(hand.grasp) for hand in config.hands}
    return Robot(hands, posture, new_label, make_surfaces(config, None), tells_body=robot.tells_body)


def make_surfaces(config: HandConfig, room: Room | None) -> Surfaces:
    return Surfaces(room, floor_watched=None if config.robot is None else config.robot.floor_watched)


def make_arm(section: ArmSection) -> Arm:
    """
    Raises:
        KinematicsError: the URDF cannot be used.
    """
    base, tool = (
        from_xyz_rpy(xyz, rpy)
        for xyz, rpy in ((section.base_xyz, section.base_rpy), (section.tool_xyz, section.tool_rpy))
    )
    if section.dh is not None:
        return dh_arm([(row.joint, row.kind, row.a, row.alpha, row.d, row.theta) for row in section.dh], base, tool)
    assert section.urdf is not None and section.tip_link is not None
    arm = read_urdf(section.urdf, section.base_link, section.tip_link)
    if np.allclose(base, np.eye(4)) and np.allclose(tool, np.eye(4)):
        return arm
    return Arm([Segment(base), *arm.segments, Segment(tool)])


def make_settings(section: GraspSection) -> GraspSettings:
    values = section.model_dump()
    fingers = FingerSettings(**{name: values.pop(name) for name in ("open_m", "empty_m", "hold_effort")})
    reads = ReadModel(**{name: values.pop(name) for name in ("p_read", "p_none")})
    return GraspSettings(fingers=fingers, reads=reads, **values)
