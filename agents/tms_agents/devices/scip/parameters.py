"""What a sensor tells of itself (PP, II, VV), and what follows for its sweeps."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np

from tms_agents.devices.scans import Sweep
from tms_agents.devices.scip.requests import Measure, OldMeasure

_SPEED = re.compile(r"(\d{2,5})\[rpm\]|^(\d{2,5})$")
_MOST_STEPS = 9999


@dataclass(frozen=True, slots=True)
class Parameters:
    """Reply to PP: distances in mm, steps of ``ares`` in a full turn, ``afrt`` looks forward, ``scan`` in 1/min."""

    modl: str
    dmin: int
    dmax: int
    ares: int
    amin: int
    amax: int
    afrt: int
    scan: int

    @classmethod
    def parse(cls, lines: Iterable[bytes]) -> Parameters:
        """Lines of text without their sums.

        Raises:
            ValueError: something is missing or impossible; says what.
        """
        found = fields(lines)
        numbers = {}
        for key in ("DMIN", "DMAX", "ARES", "AMIN", "AMAX", "AFRT", "SCAN"):
            text = found.get(key, "")
            if not (text.isascii() and text.isdigit() and len(text) <= 6):
                raise ValueError(f"{key} is {text!r}" if text else f"{key} is missing")
            numbers[key.lower()] = int(text)
        new = cls(found.get("MODL", ""), **numbers)
        if not (new.amin <= new.amax <= _MOST_STEPS and new.ares >= 4 and new.scan and new.dmin < new.dmax):
            raise ValueError(f"impossible steps, distances or speed: {new}")
        return new

    @property
    def steps(self) -> int:
        return self.amax - self.amin + 1

    def step(self, angle: float) -> int:
        """The step nearest to an angle (rad) that the sensor measures."""
        step = round(self.afrt + angle / math.tau * self.ares)
        return min(max(step, self.amin), self.amax)

    def lines(self) -> list[str]:
        """As the sensor writes them."""
        return [f"{key.upper()}:{value}" for key, value in asdict(self).items()]


def sweep(parameters: Parameters, request: Measure | OldMeasure, speed: int | None = None, skip: int = 0) -> Sweep:
    """The sweep that a request measures; ``speed`` of the motor in 1/min, None where only its standard is known.

    A cluster looks in the direction of its middle. After each sweep ``skip`` are left out.
    """
    turn_s = 60 / (speed or parameters.scan)
    starts = np.arange(request.start, request.end + 1, request.cluster)
    ends = np.minimum(starts + request.cluster - 1, request.end)
    angles = ((starts + ends) / 2 - parameters.afrt) * (math.tau / parameters.ares)
    width = request.width if isinstance(request, Measure) else 2
    return Sweep(
        angles=angles,
        time_increment_s=turn_s / parameters.ares * request.cluster,
        period_s=turn_s * (skip + 1),
        range_min_m=parameters.dmin / 1000,
        range_max_m=min(parameters.dmax, (1 << 6 * width) - 2) / 1000,
        model=parameters.modl,
    )


def first_beam_s(parameters: Parameters, request: Measure | OldMeasure, speed: int | None = None) -> float:
    """From step 0, where the sensor takes its time stamp, to the first beam."""
    middle = request.start + (min(request.cluster, request.end - request.start + 1) - 1) / 2
    return middle * 60 / (speed or parameters.scan) / parameters.ares


def motor_speed(info: dict[str, str], standard: int) -> int | None:
    """Speed of the motor (1/min) in a reply to II: ``Initial(600[rpm])<-Default...``, ``2400``.

    None where it says nothing, or nothing possible: a motor can be slowed down by a third, not more.
    """
    found = _SPEED.search(info.get("SCSP", ""))
    speed = int(found[1] or found[2]) if found else 0
    return speed if 0.6 * standard < speed < 1.2 * standard else None


def fields(lines: Iterable[bytes]) -> dict[str, str]:
    """``KEY:value`` lines of PP, VV and II."""
    found = {}
    for line in lines:
        key, colon, value = line.decode("latin-1").partition(":")
        if colon:
            found[key.strip()] = value.strip()[:200]
    return found
