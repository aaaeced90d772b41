"""What ``tms floor watch`` shows, as plain JSON: made where the scans are understood, taken by whoever looks."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from tms_agents.clocks import Clocks
from tms_agents.devices.scans import Array
from tms_agents.floor.core import Floor
from tms_agents.floor.lasers import Laser

#: A view is made this often while somebody looked within so many seconds.
_PERIOD_S, _LOOKED_S = 0.1, 2.0
_TRAIL_S = 30.0
#: What is nearer than the walls by this is drawn as something before them.
_BEFORE_M = 0.08
#: Walls of the picture come nearer slowly and go back at once (m per scan).
_NEARER_M, _FARTHER_M = 0.001, 0.1
_MOST_POINTS = 1500


class LiveView:
    """``refresh`` in the thread of the floor, ``now`` in any other."""

    def __init__(self, floor: Floor, clocks: Clocks, even: Callable[[], float] = time.monotonic) -> None:
        self._floor, self._clocks, self._even = floor, clocks, even
        self._walls: dict[str, Array] = {}
        #: How often each beam echoes of late, 0 to 1.
        self._echoes: dict[str, Array] = {}
        self._counted: dict[str, int] = {}
        self._looked = self._made = -np.inf
        self._view: dict[str, Any] = {"lasers": {}, "labels": []}

    def refresh(self) -> None:
        for name, laser in self._floor.lasers.items():
            if laser.ranges is not None and self._counted.get(name) != laser.scans:
                self._counted[name] = laser.scans
                self._learn(name, laser)
        now = self._even()
        if now - self._looked < _LOOKED_S and now - self._made >= _PERIOD_S:
            self._made = now
            self._view = self._make()

    def now(self, source: str = "agent") -> dict[str, Any]:
        """The newest view; the states of the lasers are those of this moment."""
        self._looked = self._even()
        config, made = self._floor.config, self._view
        at = self._clocks.in_step(self._clocks.now())
        lasers = []
        for name, laser in self._floor.lasers.items():
            state = laser.state
            told = {"state": "connecting", "why": ""} if state is None else {"state": state.state, "why": state.why}
            points = made["lasers"].get(name, {"walls": [], "front": []})
            lasers.append({"name": name, "pose": list(laser.pose), "scans": laser.scans, **told, **points})
        return {
            "agent": config.agent,
            "room": config.room,
            "source": source,
            "at": at.isoformat(timespec="milliseconds"),
            "lasers": lasers,
            "labels": made["labels"],
            "scene": config.scene.model_dump(mode="json"),
            "story": [(when.isoformat(timespec="milliseconds"), text) for when, text in list(self._floor.story)],
        }

    def _learn(self, name: str, laser: Laser) -> None:
        assert laser.ranges is not None
        walls = self._walls.get(name)
        if walls is None or walls.shape != laser.ranges.shape:
            self._walls[name] = laser.ranges.copy()
            self._echoes[name] = np.isfinite(laser.ranges).astype(np.float64)
            return
        self._echoes[name] += 0.03 * (np.isfinite(laser.ranges) - self._echoes[name])
        with np.errstate(invalid="ignore"):
            step = np.clip(laser.ranges - walls, -_NEARER_M, _FARTHER_M)
            unknown = ~np.isfinite(walls)
            walls[:] = np.where(unknown, laser.ranges, np.where(np.isfinite(laser.ranges), walls + step, walls))

    def _make(self) -> dict[str, Any]:
        lasers = {}
        for name, laser in self._floor.lasers.items():
            if laser.ranges is None or laser.sweep is None:
                continue
            walls = self._walls[name]
            with np.errstate(invalid="ignore"):
                front = np.isfinite(laser.ranges) & (laser.ranges < walls - _BEFORE_M)
            (x, y, theta), scale = self._floor.believed(name)
            angles, at = laser.sweep.angles + theta, (x, y)
            steady = np.isfinite(walls) & (self._echoes[name] > 0.5)
            lasers[name] = {
                "pose": [x, y, theta],
                "walls": _points(at, angles[steady], scale * walls[steady]),
                "front": _points(at, angles[front], scale * laser.ranges[front]),
            }
        now = self._clocks.now()
        known, movers = self._floor.labels, self._floor.labels.movers
        labels = []
        for one in self._floor.seen():
            label = known.things[one.id][0] if one.id in known.things else None
            trail: list[list[float]] = []
            if one.id in movers:
                label = movers[one.id].label
                trail = [[round(x, 2), round(y, 2)] for t, (x, y) in movers[one.id].places if now - t < _TRAIL_S]
            labels.append(
                {
                    "id": one.id,
                    "label": label,
                    "kind": one.kind,
                    "xy": [round(one.xy[0], 3), round(one.xy[1], 3)],
                    "sd": round(float(np.sqrt(max(one.cov[0], one.cov[2]))), 3),
                    "age_s": round(max(0.0, now - one.since), 1),
                    "robot": one.robot,
                    "stale": one.stale,
                    "trail": trail,
                }
            )
        return {"lasers": lasers, "labels": labels}


def _points(at: tuple[float, float], angles: Array, ranges: Array) -> list[list[float]]:
    """Where beams (n,) that start ``at`` x, y (m) end, in the room."""
    every = max(1, int(np.ceil(angles.size / _MOST_POINTS)))
    angles, ranges = angles[::every], ranges[::every]
    points = np.stack([at[0] + ranges * np.cos(angles), at[1] + ranges * np.sin(angles)], axis=1)
    return [[round(float(a), 2), round(float(b), 2)] for a, b in points]
