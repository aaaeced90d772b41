"""Everything that can be set for localisation, with values that hold for all worlds we know."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tms_agents.slam.motion import OdometryNoise
from tms_agents.slam.verdict import Limits


@dataclass(frozen=True, slots=True)
class LocalisationSettings:
    """Lengths in m, angles in rad. ``start`` is the pose where the robot begins, about; None: anywhere."""

    seed: int = 0
    start: tuple[float, float, float] | None = None
    start_m: float = 0.5
    start_rad: float = 0.3
    #: Particles: at most, at least, the error that KLD-sampling allows and its boxes.
    particles: int = 20_000
    least: int = 40
    error: float = 0.1
    bins: tuple[float, float] = (0.4, np.pi / 18)
    #: Poses tried per m2 of free floor when the robot may be anywhere, and at most.
    tries_per_m2: float = 600.0
    most_tries: int = 2_000_000
    #: While nothing is believed, this share of the belief goes to fresh particles at every so-manieth scan.
    anew: float = 0.05
    anew_every: int = 5
    #: So many particles are matched one by one; where there are more, they are only weighed.
    matched: int = 1500
    #: Beams that are tried at first, weighed, and matched; all beams of a scan are worth so many witnesses.
    few_beams: int = 30
    beams: int = 60
    witnesses: float = 10.0
    #: A beam through a wall counts as one that misses.
    through: bool = True
    coarse_m: float = 0.2
    fine_m: float = 0.1
    #: Scans that are remembered to compare places by; places compared; share of the belief that goes to those that
    #: cannot be told from the best one.
    remembered: int = 24
    rivals: int = 100
    rivals_share: float = 0.3
    noise: OdometryNoise = field(default_factory=OdometryNoise)
    limits: Limits = field(default_factory=Limits)
    step_m: float = 0.5
    step_rad: float = 0.25
