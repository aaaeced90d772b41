"""A recording as it was at an earlier moment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tms_agents.slam import Log
from tms_agents.slam.geometry import Floats
from tms_agents.slam.polishing import legs_of
from tms_agents.slam.semidynamic import Rounds


def until(log: Log, poses: Floats, rounds: Rounds, t: float) -> tuple[Log, Floats, Rounds]:
    """What there was at time ``t``."""
    kept = log.t <= t
    count = int(np.searchsorted(rounds.t, t, side="right"))
    part = replace(
        log, t=log.t[kept], odometry=log.odometry[kept], driven=log.driven[kept], ranges=log.ranges[kept]
    )  # fmt: skip
    return part, poses[kept], Rounds(rounds.t[:count], rounds.antenna[:count], rounds.tags[:count])


def first_pass(log: Log, poses: Floats, rounds: Rounds) -> tuple[Log, Floats, Rounds]:
    """What there was until the robot was parked for the first time."""
    return until(log, poses, rounds, float(log.t[legs_of(log.t) == 0][-1]))
