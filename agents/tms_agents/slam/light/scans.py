"""Scans with light: where the surfaces are, which way they run, how bright they are once distance and angle are out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tms_agents.slam.geometry import Floats, transform
from tms_agents.slam.keyframes import Indices
from tms_agents.slam.light.calibration import Calibration, learn
from tms_agents.slam.light.surfaces import surfaces
from tms_agents.slam.logs import Log, LogError

#: The calibration is learnt from at most so many scans, evenly chosen.
_LEARNT_FROM = 400


@dataclass(frozen=True, slots=True, eq=False)
class LightScan:
    """Beams (M,) that brought light back: ``points`` (M, 2) m and ``tangents`` (M, 2) of their surfaces seen from the
    robot, ``light`` (M,) log intensity less that of a usual surface met so, and its ``deviation``."""

    points: Floats
    tangents: Floats
    light: Floats
    deviation: Floats

    def thinned(self, most: int) -> LightScan:
        """At most ``most`` of the beams, evenly chosen."""
        if len(self.points) <= most:
            return self
        chosen = np.linspace(0, len(self.points) - 1, most).round().astype(int)
        return LightScan(self.points[chosen], self.tangents[chosen], self.light[chosen], self.deviation[chosen])


class LightError(LogError):
    """The log holds no light that could be used; the text says why in one line."""


def contrast(scans: Sequence[LightScan]) -> float:
    """How many times more the light of all beams scatters than by its noise: 1 where all surfaces are alike."""
    light, deviation = (np.concatenate([getattr(s, name) for s in scans]) for name in ("light", "deviation"))
    return float(np.std(light) / np.sqrt(np.mean(np.square(deviation)))) if len(light) else 0.0


def calibrated(log: Log) -> Calibration:
    """What the whole log says of the laser.

    Raises:
        LightError: the log holds no intensity, or too little.
    """
    if log.intensities is None:
        raise LightError("it holds no received light intensity")
    every = max(1, len(log) // _LEARNT_FROM)
    parts = [_beams(log, n) for n in range(0, len(log), every)]
    ranges, incidence, intensities = (
        np.concatenate(column) for column in zip(*((a, c, d) for a, _, c, d, _ in parts), strict=True)
    )
    try:
        return learn(ranges, incidence, intensities)
    except ValueError as error:
        raise LightError(f"its light cannot be used: {error}") from error


def light_scans(log: Log, keys: Indices, calibration: Calibration) -> Sequence[LightScan]:
    """The scans ``keys`` (K,) of the log."""
    found = []
    for n in keys:
        ranges, tangents, incidence, intensities, points = _beams(log, int(n))
        light, deviation = calibration.normalised(ranges, incidence, intensities)
        usable = np.isfinite(light)
        found.append(LightScan(points[usable], tangents[usable], light[usable], deviation[usable]))
    return found


def merged(scans: list[LightScan], poses: Floats) -> LightScan:
    """One cloud of ``scans`` seen from ``poses`` (K, 3)."""
    turned = poses * np.array([0.0, 0.0, 1.0])
    return LightScan(
        np.concatenate([transform(p, s.points) for p, s in zip(poses, scans, strict=True)]),
        np.concatenate([transform(p, s.tangents) for p, s in zip(turned, scans, strict=True)]),
        np.concatenate([s.light for s in scans]),
        np.concatenate([s.deviation for s in scans]),
    )


def _beams(log: Log, n: int) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """(ranges, tangents, incidence, intensities, points) of the beams of a scan that returned."""
    assert log.intensities is not None
    returned = log.returned(n)
    points = log.points(n)
    tangents, incidence = surfaces(points, np.ascontiguousarray(log.laser[:2]))
    intensities = np.nan_to_num(log.intensities[n, returned], nan=0.0, posinf=0.0)
    return log.ranges[n, returned], tangents, incidence, intensities, points
