"""A drive mapped scan by scan: where the robot is in the room after each, and the map so far. Pure."""

from __future__ import annotations

from datetime import datetime

import numpy as np

from tms_agents.robot.map_uploader import Grid
from tms_agents.slam.filter import ParticleFilter
from tms_agents.slam.geometry import Floats, compose
from tms_agents.slam.gridmap import grid_map
from tms_agents.slam.keyframes import key_scans
from tms_agents.slam.logs import Log
from tms_agents.slam.settings import Settings
from tms_schemas.base import Pose
from tms_schemas.observation import PoseReport


class Mapper:
    """``start`` is the robot's pose in the room at the first scan, None where nobody knows it."""

    def __init__(self, log: Log, settings: Settings, start: Pose | None) -> None:
        self._log, self._start = log, start
        self._particles = ParticleFilter(settings, log.laser)
        self.keys = [int(n) for n in key_scans(log, settings.step_m, settings.step_rad)]

    def due_s(self, key: int) -> float:
        """Seconds from the beginning of the drive to the scan."""
        return float(self._log.t[key] - self._log.t[self.keys[0]])

    def scan(self, key: int) -> None:
        """Take in one of ``keys``, in their order."""
        self._particles.process(self._log.odometry[key], self._log.driven[key], self._log.points(key))

    def body(self, at: datetime, label: str) -> list[PoseReport]:
        """What is to be told of the robot's body now."""
        if self._start is None:
            return []
        best: Floats = self._particles.poses[self._particles.best]
        x, y, theta = (float(one) for one in compose(np.array(self._start), best))
        return [PoseReport(seq=0, observed_at=at, label=label, pose=(x, y, theta))]

    def grid(self) -> Grid:
        found = grid_map(self._particles.maps, self._particles.best)
        return Grid(found.probabilities(), found.origin)
