"""Where the sensors really are: feet that several of them see at once tell by how much their poses disagree."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tms_agents.floor.settings import Pose

Array = NDArray[np.float64]

#: Poses are given about so well (m, rad); one sighting is so good (m), and sightings of one foot resemble each other.
_PLACE_M, _TURN_RAD, _SIGHT_M, _SHARE = 0.03, 0.012, 0.03, 0.15
#: Sightings of one place belong together within this time (s) and distance (m).
_SOON_S, _NEAR_M = 0.25, 0.15
#: The poses are revised this often (s); old sightings fade by this factor each time.
_EVERY_S, _FADE = 10.0, 0.98


class Extrinsics:
    """Corrections of the poses of all sensors but the first: weighted least squares, the given poses as prior."""

    def __init__(self, poses: list[Pose]) -> None:
        self._given = [np.array(pose) for pose in poses]
        count = len(poses)
        prior = np.diag([_PLACE_M**-2, _PLACE_M**-2, _TURN_RAD**-2])
        self._prior = prior
        self._information = np.zeros((count, 3, 3))
        self._evidence = np.zeros((count, 3))
        self.corrections = np.zeros((count, 3))
        self._sights: dict[int, dict[int, tuple[float, float, float]]] = {}
        self._revised = -math.inf

    def see(self, sensor: int, clusters: Any, of: NDArray[np.int64], prints: Any, t: float) -> bool:
        """Take in the clusters (m,) of a scan of ``sensor`` and their prints; whether the poses have been revised."""
        for k in range(clusters.size):
            c, index = clusters[k], int(of[k])
            if index < 0 or c["cut"] or c["n"] < 3 or c["width"] > 0.3 or prints[index]["hits"] < 2:
                continue
            sights = self._sights.setdefault(index, {})
            here = (t, float(c["x"]), float(c["y"]))
            for other, there in sights.items():
                if other != sensor and t - there[0] < _SOON_S:
                    self._compare(sensor, here, other, there)
            sights[sensor] = here
        if t - self._revised < _EVERY_S:
            return False
        self._revised = t
        self._sights = {i: s for i, s in self._sights.items() if any(t - there[0] < _SOON_S for there in s.values())}
        return self._revise()

    def pose(self, sensor: int) -> Pose:
        """The pose of a sensor as it is believed now."""
        x, y, heading = (self._given[sensor] + self.corrections[sensor]).tolist()
        return x, y, heading

    def _compare(self, one: int, here: tuple[float, float, float], two: int, there: tuple[float, float, float]) -> None:
        """The same foot seen by two sensors: each is held against the other as that one is believed now."""
        for sensor, mine, yours in ((one, here, there), (two, there, here)):
            if sensor == 0:
                continue
            gap = np.array([yours[1] - mine[1], yours[2] - mine[2]])
            if float(np.hypot(*gap)) > _NEAR_M:
                continue
            x, y = mine[1] - self._given[sensor][0], mine[2] - self._given[sensor][1]
            jacobian = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])
            weight = _SHARE / _SIGHT_M**2
            # Against the given pose, not against what it has been corrected to.
            gap = gap + jacobian @ self.corrections[sensor]
            self._information[sensor] += weight * jacobian.T @ jacobian
            self._evidence[sensor] += weight * jacobian.T @ gap

    def _revise(self) -> bool:
        changed = False
        for sensor in range(1, len(self._given)):
            if not self._information[sensor].any():
                continue
            solution = np.linalg.solve(self._information[sensor] + self._prior, self._evidence[sensor])
            if float(np.abs(solution - self.corrections[sensor]).max()) > 5e-4:
                self.corrections[sensor] = solution
                changed = True
            self._information[sensor] *= _FADE
            self._evidence[sensor] *= _FADE
        return changed

    # --- across restarts

    def save(self) -> dict[str, Any]:
        """What to keep, as JSON values."""
        return {
            "information": self._information.tolist(),
            "evidence": self._evidence.tolist(),
            "corrections": self.corrections.tolist(),
            "sights": [[i, [[s, *there] for s, there in sights.items()]] for i, sights in self._sights.items()],
            "revised": self._revised if math.isfinite(self._revised) else None,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from what was kept."""
        self._information = np.array(state["information"], dtype=float)
        self._evidence = np.array(state["evidence"], dtype=float)
        self.corrections = np.array(state["corrections"], dtype=float)
        self._sights = {int(i): {int(s): (t, x, y) for s, t, x, y in sights} for i, sights in state["sights"]}
        self._revised = -math.inf if state["revised"] is None else float(state["revised"])
