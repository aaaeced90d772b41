"""Where the sensors really are, and how far what they measure really is: feet that several see at once tell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tms_agents.floor.settings import Pose

Array = NDArray[np.float64]

#: Poses are given about so well (m, m, rad), and a ruler errs by so much of which nothing is known.
_GIVEN = (0.03, 0.03, 0.012, 0.008)
#: The same where walls have told; and how well the scale is known that was told.
_AT_WALLS, _TOLD = (0.005, 0.005, 0.002, 0.0005), 0.0005
#: One sighting is so good (m), and sightings of one foot resemble each other.
_SIGHT_M, _SHARE = 0.03, 0.15
#: Sightings of one place belong together within this time (s) and distance (m).
_SOON_S, _NEAR_M = 0.25, 0.15
#: The poses are revised this often (s), if they change by so much (m, rad, share); old sightings fade by this factor
#: each time.
_EVERY_S, _LEAST, _FADE = 10.0, 5e-4, 0.98


class Extrinsics:
    """Corrections of the poses and of the range scales of all sensors, from what two of them saw of one foot at a time.

    Weighted least squares, with what is given as prior. The pose of the first sensor is held: it is what ties the room
    frame. ``told`` (n,): whether the scale of a sensor is known.
    """

    def __init__(self, poses: Sequence[Pose], told: Sequence[bool]) -> None:
        self._given = np.array(poses, dtype=float)
        count = len(poses)
        #: How well the pose and the scale of each are known without the others (standard deviations).
        self._known = np.array([(*_GIVEN[:3], _TOLD if known else _GIVEN[3]) for known in told])
        self._information = np.zeros((4 * count, 4 * count))
        self._evidence = np.zeros(4 * count)
        #: Of each sensor: x, y (m), heading (rad), and by which share it measures too little.
        self.corrections = np.zeros((count, 4))
        self._sights: dict[int, dict[int, tuple[float, float, float]]] = {}
        self._revised = -math.inf

    def place(self, sensor: int, pose: Pose) -> None:
        """Walls have told where the sensor is, and how it measures."""
        self._given[sensor], self._known[sensor] = pose, _AT_WALLS

    def see(self, sensor: int, clusters: Any, of: NDArray[np.int64], prints: Any, t: float) -> bool:
        """Take in the clusters (m,) of a scan of ``sensor`` and their prints; whether the poses have been revised."""
        for k in range(clusters.size):
            c, index = clusters[k], int(of[k])
            unfit = c["cut"] or c["n"] < 3 or c["width"] > 0.3 or c["mirror"] >= 0
            if index < 0 or unfit or prints[index]["hits"] < 2:
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
        x, y, heading = (self._given[sensor] + self.corrections[sensor, :3]).tolist()
        return x, y, heading

    def scale(self, sensor: int) -> float:
        """What it measures, as was known before, times this is how far it is, as it is believed now."""
        return 1.0 + float(self.corrections[sensor, 3])

    def _compare(self, one: int, here: tuple[float, float, float], two: int, there: tuple[float, float, float]) -> None:
        """The same foot seen by two sensors, each as it is believed now."""
        gap = np.array([there[1] - here[1], there[2] - here[2]])
        if float(np.hypot(*gap)) > _NEAR_M:
            return
        jacobian = np.zeros((2, self._evidence.size))
        for sensor, sight, sign in ((one, here, 1.0), (two, there, -1.0)):
            x, y = sight[1] - self.pose(sensor)[0], sight[2] - self.pose(sensor)[1]
            jacobian[:, 4 * sensor : 4 * sensor + 4] = sign * np.array([[1.0, 0.0, -y, x], [0.0, 1.0, x, y]])
        weight = _SHARE / _SIGHT_M**2
        self._information += weight * jacobian.T @ jacobian
        # Against what is given, not against what it has been corrected to.
        self._evidence += weight * jacobian.T @ (gap + jacobian @ self.corrections.ravel())

    def _revise(self) -> bool:
        if not self._information.any():
            return False
        solution = np.zeros_like(self._evidence)
        free = slice(3, None)
        information = self._information + np.diag(self._known.ravel() ** -2)
        solution[free] = np.linalg.solve(information[free, free], self._evidence[free])
        self._information *= _FADE
        self._evidence *= _FADE
        if float(np.abs(solution - self.corrections.ravel()).max()) < _LEAST:
            return False
        self.corrections = solution.reshape(-1, 4)
        return True

    # --- across restarts

    def save(self) -> dict[str, Any]:
        """What to keep, as JSON values."""
        return {
            "given": self._given.tolist(),
            "known": self._known.tolist(),
            "information": self._information.tolist(),
            "evidence": self._evidence.tolist(),
            "corrections": self.corrections.tolist(),
            "sights": [[i, [[s, *there] for s, there in sights.items()]] for i, sights in self._sights.items()],
            "revised": self._revised if math.isfinite(self._revised) else None,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from what was kept."""
        self._given, self._known = np.array(state["given"], dtype=float), np.array(state["known"], dtype=float)
        self._information = np.array(state["information"], dtype=float)
        self._evidence = np.array(state["evidence"], dtype=float)
        self.corrections = np.array(state["corrections"], dtype=float)
        self._sights = {int(i): {int(s): (t, x, y) for s, t, x, y in sights} for i, sights in state["sights"]}
        self._revised = -math.inf if state["revised"] is None else float(state["revised"])
