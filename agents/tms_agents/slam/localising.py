"""A recorded drive, localised in a known map: scan by scan, as a robot would, without a look ahead."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats, between, compose
from tms_agents.slam.keyframes import Indices, key_scans
from tms_agents.slam.known import KnownMap
from tms_agents.slam.localisation import Estimate, Localiser
from tms_agents.slam.localisation_settings import LocalisationSettings
from tms_agents.slam.logs import Log


@dataclass(frozen=True, slots=True, eq=False)
class Localised:
    """``keys`` (K,) scans that were processed, ``estimates`` after each and their CPU times (s) in this process;
    ``poses`` (S, 3) of all scans in the map, from the estimate before on by odometry, and ``believed`` (S,) whether the
    robot was localised then."""

    keys: Indices
    estimates: list[Estimate]
    seconds: Floats
    poses: Floats
    believed: NDArray[np.bool_]

    @property
    def first(self) -> int | None:
        """Number of the estimate at which the robot was localised for the first time."""
        return next((k for k, one in enumerate(self.estimates) if one.localised), None)


def localise(
    log: Log, known: KnownMap, settings: LocalisationSettings, progress: Callable[[int, int, Estimate], None]
) -> Localised:
    """All of ``log``; ``progress`` is told the number of scans done, of all, and what is known after each."""
    keys = key_scans(log, settings.step_m, settings.step_rad)
    localiser = Localiser(known, settings, log.laser)
    estimates: list[Estimate] = []
    seconds = np.zeros(len(keys))
    for k, n in enumerate(keys):
        began = time.process_time()
        estimates.append(localiser.process(log.odometry[n], log.driven[n], log.points(int(n))))
        seconds[k] = time.process_time() - began
        progress(k + 1, len(keys), estimates[-1])
    last = np.searchsorted(keys, np.arange(len(log)), side="right") - 1
    best = np.array([one.best.pose for one in estimates])
    poses = compose(best[last], between(log.odometry[keys[last]], log.odometry))
    return Localised(keys, estimates, seconds, poses, np.array([one.localised for one in estimates])[last])
