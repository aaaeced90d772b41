"""Simulated laser range finders: how they sweep, how they err, where they stand."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from tms_agents.devices.scans import Sweep
from tms_agents.simulation.floor_world.shapes import Pose


@dataclass(frozen=True, kw_only=True, slots=True)
class NoiseParameters:
    """Errors as measured on recordings of URG-class lasers; a recording's mean behaviour is no easier than this.

    sigma: standard deviation (m) at the distances ``sigma_at_m``, linear between them; ``grazing`` is the factor at 90
    degrees of incidence (1 up to 60). ``moving_average`` correlates adjacent beams (lag 1 0.59, lag 2 0.22), ``memory``
    adjacent scans. All that a device measures is too long or too short by up to the share ``longer``. A beam of the
    ``intermittent`` share falls silent and stays so with the given probabilities. At ``fades_at_m`` every other beam
    that meets something white is lost, more beyond it and fewer before; what is darker is lost nearer, as its
    reflectivity by the power ``fades_power``.
    """

    sigma_at_m: tuple[float, ...] = (0.0, 3.0, 4.0, 5.6, 10.0)
    sigma_m: tuple[float, ...] = (0.0032, 0.0042, 0.0075, 0.012, 0.02)
    grazing: float = 2.5
    moving_average: tuple[float, float] = (0.7, 0.35)
    memory: float = 0.1
    common_m: float = 0.0011
    longer: float = 0.012
    angle_jitter: float = 0.12  # of a scan, in steps between beams
    intermittent: float = 0.03
    silent_again: float = 0.82
    silent_next: float = 0.13
    isolated: float = 0.005
    error_code: float = 0.0002
    fades_at_m: float = math.inf
    fades_over_m: float = 0.33
    fades_power: float = 0.4
    mixed: float = 0.06  # of edges higher than 5 cm
    warm_up_m: float = 0.003
    warm_up_s: float = 900.0
    drift_m: float = 0.002
    drift_s: float = 600.0
    quantum_m: float = 0.001
    time_jitter_s: float = 0.001
    missing: float = 0.003
    missing_more: float = 0.4


@dataclass(frozen=True, kw_only=True, slots=True)
class Laser:
    """A model. ``beams`` from ``first_angle`` to its negative; the mirror turns once per ``period_s``."""

    model: str
    beams: int
    field_of_view: float
    period_s: float = 0.1
    range_min_m: float = 0.02
    range_max_m: float
    noise: NoiseParameters = field(default_factory=NoiseParameters)

    @property
    def first_angle(self) -> float:
        return -self.field_of_view / 2

    @property
    def step(self) -> float:
        return self.field_of_view / (self.beams - 1)

    @property
    def increment_s(self) -> float:
        return self.period_s * self.step / (2 * math.pi)

    def sweep(self) -> Sweep:
        """As its driver describes it."""
        return Sweep(
            angles=np.linspace(-self.field_of_view / 2, self.field_of_view / 2, self.beams),
            time_increment_s=self.increment_s,
            period_s=self.period_s,
            range_min_m=self.range_min_m,
            range_max_m=self.range_max_m,
            model=self.model,
        )


#: Fine in angle, with the errors that were measured on the coarse one.
FINE = Laser(model="1081 beams", beams=1081, field_of_view=math.radians(270), range_max_m=10.0)
COARSE = Laser(model="URG-04LX", beams=683, field_of_view=math.radians(682 * 360 / 1024), range_max_m=5.6)
#: The same, of which beams come back as seldom as in the shared samples: of those that meet legs there 0.8 at 3.7 m,
#: 0.4 at 4.2 and 0.2 at 4.7; here 0.7, 0.4 and 0.3, of dark ones fewer.
FAINT = replace(COARSE, model="URG-04LX, faint", noise=NoiseParameters(fades_at_m=5.6))
LASERS = {"fine": FINE, "coarse": COARSE, "faint": FAINT}


@dataclass(frozen=True, kw_only=True, slots=True)
class Mount:
    """A laser in the room: where it is, and where its user believes it to be."""

    name: str
    laser: Laser
    pose: Pose
    reported: Pose


def misplaced(name: str, laser: Laser, pose: Pose, rng: np.random.Generator, metres: float, degrees: float) -> Mount:
    """A mount whose reported pose is off by just this much, in a random direction."""
    direction = rng.uniform(0, 2 * math.pi)
    turn = math.radians(degrees) * (1 if rng.random() < 0.5 else -1)
    reported = (
        pose[0] + metres * math.cos(direction),
        pose[1] + metres * math.sin(direction),
        math.remainder(pose[2] + turn, 2 * math.pi),
    )
    return Mount(name=name, laser=laser, pose=pose, reported=reported)
