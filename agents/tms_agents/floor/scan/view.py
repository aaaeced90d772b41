"""One sensor: its beams in the room, its background, and how a scan of it is cleaned up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.scan.background import Background
from tms_agents.floor.scan.freespace import Sight, beam_of
from tms_agents.floor.scan.rays import rays, views
from tms_agents.floor.scan.segmentation import Segmenter
from tms_agents.floor.scan.walls import Fit, held_against
from tms_agents.floor.settings import FloorSettings, Point, Polygon, Pose, Sensor
from tms_agents.floor.state import pack, unpack

Array = NDArray[np.float64]

#: No laser sees so far (m) along a floor: a device that says so means nothing.
_ENDLESS_M = 500.0


@njit(cache=True)
def _clean(ranges: Array, nearest: float, farthest: float, scale: float, out: Array) -> None:
    """Error codes and NaN become NaN, what is beyond reach no echo (inf), and the rest is ``scale`` times as far."""
    for i in range(ranges.size):
        r = ranges[i]
        if np.isnan(r) or r < nearest:
            out[i] = np.nan
        elif r >= farthest:
            out[i] = np.inf
        else:
            out[i] = scale * r


class View:
    """What belongs to one sensor."""

    def __init__(
        self, index: int, sensor: Sensor, settings: FloorSettings, mirrors: Sequence[tuple[Point, Point]]
    ) -> None:
        angles = np.asarray(sensor.sweep.angles, dtype=float)
        if angles.ndim != 1 or angles.size < 8:
            raise ValueError("a sensor of the floor needs at least eight beams")
        steps = np.diff(angles)
        if not (np.all(steps > 0) or np.all(steps < 0)):
            raise ValueError("the beams of a sensor must be in the order of their angles")
        self.index, self.sensor, self.mirrors = index, sensor, mirrors
        self.n = angles.size
        self.first, self.step = float(angles[0]), float(steps.mean())
        self.background = Background(self.n, self.step, settings)
        self.segment = Segmenter(np.abs(np.append(steps, steps[-1])), settings.grazing_rad)
        self.ranges = np.zeros(self.n)
        self.claimed = np.zeros(self.n, np.bool_)
        self.last: float | None = None
        #: What it measures times this is how far it is; nothing until that is known.
        self.range_scale = sensor.range_scale
        #: And times this, as other sensors tell.
        self.refined = 1.0
        self.ways = views(mirrors)
        self.move(sensor.pose)

    def move(self, pose: Pose) -> None:
        """The sensor stands at ``pose``."""
        self.pose = np.array(pose, dtype=float)
        self.rays = rays(self.sensor, pose, self.mirrors)

    def refine(self, scale: float) -> None:
        """Other sensors tell that everything is ``scale`` times as far as this one alone would know."""
        ratio, self.refined = scale / self.refined, scale
        self.background.stretch(ratio)
        self.ranges *= ratio

    @property
    def scale(self) -> float:
        """What it measures times this is how far it is, as far as is known now."""
        return (self.range_scale or 1.0) * self.refined

    def take(self, ranges: Array) -> None:
        """Take in a scan (n,) m."""
        least = max(self.sensor.sweep.range_min_m, 0.02)
        _clean(np.asarray(ranges, dtype=np.float64), least, self._reach_m, self.scale, self.ranges)

    def compare(self, outline: Polygon | None) -> Fit | None:
        """Hold what the sensor sees against the walls of the room, if they are known: where it is, if they tell."""
        self.range_scale, fit = 1.0, None
        if outline is not None:
            points = self.background.points(np.asarray(self.sensor.sweep.angles, dtype=float))
            fit = held_against(points, outline, self.sensor.pose)
        if fit is not None:
            self.range_scale = fit.range_scale
            self.background.stretch(fit.range_scale)
            self.ranges *= fit.range_scale
            self.move(fit.pose)
        return fit

    def overlooks(self, x: float, y: float) -> bool:
        """Whether it would see directly what stands at (x, y) m in the empty room."""
        dx, dy = x - float(self.pose[0]), y - float(self.pose[1])
        beam = beam_of(math.atan2(dy, dx) - float(self.pose[2]), self.first, self.step, self.n)
        if math.isnan(beam):
            return False
        far = min(self.background.longest[min(max(round(beam), 0), self.n - 1)], self._reach_m * self.scale)
        return bool(math.hypot(dx, dy) < far)

    def save(self) -> dict[str, Any]:
        """JSON values."""
        arrays, numbers = self.background.save()
        packed = {name: pack(array) for name, array in arrays.items()}
        own = {"pose": self.pose.tolist(), "last": self.last}
        own |= {"range_scale": self.range_scale, "refined": self.refined}
        return {"background": packed, **numbers, **own}

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        like, _ = self.background.save()
        arrays = {name: unpack(saved["background"][name], array) for name, array in like.items()}
        self.background.restore(arrays, saved)
        self.last = saved["last"]
        scale = None if saved["range_scale"] is None else float(saved["range_scale"])
        if self.sensor.range_scale is not None and self.sensor.range_scale != scale:
            raise ValueError("the saved background is of a sensor that measured otherwise")
        self.range_scale, self.refined = scale, float(saved["refined"])
        self.move(tuple(saved["pose"]))

    @property
    def sight(self) -> Sight:
        """What it sees now."""
        b = self.background
        return self.ranges, b.states, b.steady, self.pose, self.first, self.step

    @property
    def reach(self) -> tuple[Array, float, Array, Array]:
        """What `edges.edges_of_sight` needs: how far each beam looks in the empty room, or to a mirror."""
        farthest = np.minimum(self.background.longest, self.rays[:, 8])
        farthest[farthest > _ENDLESS_M] = np.inf
        far = self._reach_m * self.scale
        if far > _ENDLESS_M:
            # It sees as far as anything that was seen.
            far = float(np.max(farthest, initial=0.0, where=np.isfinite(farthest))) + 1e-3
        return farthest, far, np.asarray(self.sensor.sweep.angles, dtype=float), self.pose

    @property
    def _reach_m(self) -> float:
        """What measures more tells nothing."""
        return self.sensor.sweep.range_max_m - 1e-3
