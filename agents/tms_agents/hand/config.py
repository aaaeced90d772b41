"""Configuration of ``tms agent hand``; examples are in ``examples`` beside this file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from tms_agents.config import AgentConfig, LocalPath, Seconds, Section
from tms_agents.hand.state_sources import StateSource
from tms_agents.readers import CaptureSource, ReaderSource
from tms_agents.running import Heartbeat
from tms_schemas.base import Name, Pose

Metre = Annotated[float, Field(ge=-10, le=10)]
Distance = Annotated[float, Field(gt=0, le=10)]
Angle = Annotated[float, Field(ge=-1000, le=1000)]
Triple = tuple[Metre, Metre, Metre]
Angles = tuple[Angle, Angle, Angle]
Chance = Annotated[float, Field(gt=0, lt=1)]


class VisitSection(Section):
    """A visit is a tag in view without a gap longer than ``gap_s``.

    ``count = "visits"`` posts each visit once, when it begins: the count in the unknown-tag list is how often the
    tag came. ``count = "reports"`` posts every report of the reader: the count is how often the reader reported it,
    whatever number of single reads a report sums up. The default is visits for a reader, which would otherwise flood
    the log, and reports for a capture, whose counts one wants to check against its bytes.
    """

    gap_s: Seconds = 2.0
    count: Literal["visits", "reports"] | None = None


class DhRow(Section):
    """One row of a standard Denavit-Hartenberg table (metres, radians); ``joint`` is left out of a fixed piece."""

    joint: str | None = None
    kind: Literal["turns", "slides"] = "turns"
    a: Metre = 0.0
    alpha: Angle = 0.0
    d: Metre = 0.0
    theta: Angle = 0.0


class ArmSection(Section):
    """The arm that carries the hand: a URDF file and the link of the gripper, or a DH table."""

    urdf: LocalPath | None = None
    #: Link that the base pose is of (default: the root of the file), and link of the gripper.
    base_link: str | None = None
    tip_link: str | None = None
    dh: Annotated[list[DhRow], Field(min_length=1, max_length=100)] | None = None
    #: Where the table starts on the robot, and the gripper in the frame of its last row (or of the tip link).
    base_xyz: Triple = (0.0, 0.0, 0.0)
    base_rpy: Angles = (0.0, 0.0, 0.0)
    tool_xyz: Triple = (0.0, 0.0, 0.0)
    tool_rpy: Angles = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _one_kind(self) -> ArmSection:
        if (self.urdf is None) == (self.dh is None):
            raise ValueError("give either urdf or dh")
        if (self.urdf is None) != (self.tip_link is None):
            raise ValueError("a urdf needs tip_link, the link of the gripper; a dh table has none")
        return self


class GraspSection(Section):
    """When something is in the hand; see ``settings.GraspSettings``, ``fingers`` and ``evidence`` for each."""

    open_m: Distance = 0.08
    empty_m: Annotated[float, Field(ge=0, le=1)] = 0.004
    hold_effort: Annotated[float, Field(gt=0)] | None = None
    settle_s: Seconds = 0.3
    lift_m: Distance = 0.1
    place_m: Distance = 0.3
    hold_s: Seconds = 5.0
    tag_wait_s: Seconds = 2.0
    sure: Annotated[float, Field(gt=0.5, lt=1)] = 0.95
    drop_s: Seconds = 0.5
    drop_looks: Annotated[int, Field(ge=2, le=1000)] = 3
    lost_s: Seconds = 20.0
    release_s: Seconds = 1.0
    look_s: Seconds = 0.25
    gap_s: Seconds = 5.0
    step_m: Distance = 0.1
    step_s: Seconds = 0.5
    p_read: Chance = 0.8
    p_none: Chance = 0.1


class HandSection(Section):
    """One hand of the robot; ``name`` is what the robot's messages call its gripper."""

    name: Name
    #: Its reader; without one the antennas of the agent's ``source``, or no reader at all.
    source: ReaderSource | None = None
    antennas: list[int] | None = None
    zone: Name | None = None
    arm: ArmSection | None = None
    grasp: GraspSection = GraspSection()


class RobotSection(Section):
    """What the robot tells of itself, and how exact that is."""

    states: StateSource
    #: Take the times of the robot's messages instead of this computer's.
    robot_clock: bool = False
    #: Where a robot stands that tells no base pose; height of its frame above the floor.
    base: Pose | None = None
    base_z: Metre = 0.0
    base_sd_m: Annotated[float, Field(ge=0, le=100)] = 0.05
    base_sd_rad: Annotated[float, Field(ge=0, le=7)] = 0.02
    joint_sd: Annotated[float, Field(ge=0, le=7)] = 0.005
    gripper_sd_m: Annotated[float, Field(ge=0, le=10)] = 0.01
    #: Post the robot's body as a mover. False where another agent of the same robot does.
    tells_body: bool = True
    #: Whether a laser watches the floor; by default where the room has a sensor of kind ``floor``.
    floor_watched: bool | None = None


class HandConfig(AgentConfig):
    """Without ``hands`` the reader's tags are posted as raw reads and nothing else."""

    source: ReaderSource | None = None
    #: Name of the zone that the reader covers, and names for single antennas that cover another one.
    zone: Name = "hand"
    zones: dict[str, Name] = {}
    visits: VisitSection = VisitSection()
    robot: RobotSection | None = None
    hands: Annotated[list[HandSection], Field(max_length=10)] = []
    #: With hands: post tags in view that are not (yet) known to be in a hand, too.
    raw_reads: bool = True
    #: The device is called silent when nothing valid came for this long.
    silent_after_s: Seconds = 10.0
    #: The state of the device is posted again this often, so that a quiet agent is not taken for a dead one.
    heartbeat_s: Heartbeat = 10.0

    @model_validator(mode="after")
    def _fits_together(self) -> HandConfig:
        if not self.hands and self.source is None:
            raise ValueError("give a [source], or [[hands]]")
        if bool(self.hands) != (self.robot is not None):
            raise ValueError("[[hands]] and [robot] belong together: the robot tells what its grippers do")
        sources = [self.source, *(hand.source for hand in self.hands)]
        if self.hands and any(isinstance(source, CaptureSource) for source in sources):
            raise ValueError("a capture has no robot: it goes without [[hands]]")
        names = [hand.name for hand in self.hands]
        if len(set(names)) != len(names):
            raise ValueError("two hands have the same name")
        if self.source is None and any(hand.antennas is not None and hand.source is None for hand in self.hands):
            raise ValueError("a hand names antennas, but there is no reader")
        return self

    @property
    def counts_visits(self) -> bool:
        """Post a tag once per visit; otherwise at every report."""
        default = "reports" if isinstance(self.source, CaptureSource) else "visits"
        return (self.visits.count or default) == "visits"

    def zone_of(self, antenna: int) -> str:
        return self.zones.get(str(antenna), self.zone)
