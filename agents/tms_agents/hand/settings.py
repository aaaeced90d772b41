"""When a hand counts as having grasped, released or lost something."""

from __future__ import annotations

from dataclasses import dataclass

from tms_agents.hand.evidence import ReadModel
from tms_agents.hand.fingers import FingerSettings

_FINGERS, _READS = FingerSettings(), ReadModel()


@dataclass(frozen=True, kw_only=True, slots=True)
class GraspSettings:
    """Times in seconds, distances in metres.

    Args:
        settle_s: fingers that stood still for this long have closed.
        lift_m: so far from where it closed, the hand has lifted what it holds.
        place_m: so far away, the reader is among other tags: its range, and a little more.
        hold_s: a thing held for this long where the hand closed counts as lifted too (somebody put it into the hand).
        tag_wait_s: a lifted thing is told without a tag after this; its tag may follow.
        sure: probability from which on a tag is taken for the one in the hand.
        drop_s: fingers that have met for this long may have lost what they held.
        drop_looks: and its tag was not read in this many looks since.
        lost_s: where no sensor of the fingers tells, a tag not read for this long means that the thing is gone.
        release_s: an opened hand that stays where it is has released what it held after this.
        look_s: a look of a reader that does not tell its rounds.
        gap_s: after so long without a message of the gripper nobody knows what it did meanwhile.
        step_m, step_s: a carried thing is told again after this distance and not sooner than this time.
    """

    fingers: FingerSettings = _FINGERS
    reads: ReadModel = _READS
    settle_s: float = 0.3
    lift_m: float = 0.1
    place_m: float = 0.3
    hold_s: float = 5.0
    tag_wait_s: float = 2.0
    sure: float = 0.95
    drop_s: float = 0.5
    drop_looks: int = 3
    lost_s: float = 20.0
    release_s: float = 1.0
    look_s: float = 0.25
    gap_s: float = 5.0
    step_m: float = 0.1
    step_s: float = 0.5
