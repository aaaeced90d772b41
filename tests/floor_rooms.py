"""A small room for tests: walls, round things and boxes, seen by a laser, with or without noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.scans import Sweep
from tms_agents.floor import FloorEstimator, FloorEvent, FloorSettings, Scene, Sensor

Array = NDArray[np.float64]
Circle = tuple[float, float, float]
Segment = tuple[float, float, float, float]

#: A room of 5 m by 4 m.
WALLS: tuple[Segment, ...] = ((0, 0, 5, 0), (5, 0, 5, 4), (5, 4, 0, 4), (0, 4, 0, 0))


def sweep(beams: int = 541, fan: float = math.pi / 2, reach: float = 8.0) -> Sweep:
    """A sweep over ``fan`` rad, ten times a second."""
    return Sweep(np.linspace(-fan / 2, fan / 2, beams), 1e-4, 0.1, 0.05, reach)


def box(x: float, y: float, width: float, depth: float) -> tuple[Segment, ...]:
    """The sides of a box around (x, y)."""
    a, b, c, d = x - width / 2, y - depth / 2, x + width / 2, y + depth / 2
    return ((a, b, c, b), (c, b, c, d), (c, d, a, d), (a, d, a, b))


def cast(sensor: Sensor, circles: Sequence[Circle], segments: Sequence[Segment]) -> Array:
    """The true ranges (n,) m; inf where nothing is within reach."""
    x, y, heading = sensor.pose
    angles = sensor.sweep.angles + heading
    dx, dy = np.cos(angles), np.sin(angles)
    best = np.full(angles.size, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for cx, cy, radius in circles:
            along = (cx - x) * dx + (cy - y) * dy
            off = (cx - x) ** 2 + (cy - y) ** 2 - along**2
            r = along - np.sqrt(np.maximum(radius**2 - off, 0.0))
            best = np.where((off < radius**2) & (r > 0), np.minimum(best, r), best)
        for ax, ay, bx, by in segments:
            cross = dx * (by - ay) - dy * (bx - ax)
            r = ((ax - x) * (by - ay) - (ay - y) * (bx - ax)) / cross
            share = ((ax - x) * dy - (ay - y) * dx) / cross
            meets = (r > 0) & (share >= 0) & (share <= 1)
            best = np.where(meets, np.minimum(best, r), best)
    return np.where(best < sensor.sweep.range_max_m, best, np.inf)


@dataclass
class Room:
    """A room played to an estimator: what stands there is a function of time."""

    circles: Callable[[float], Sequence[Circle]] = lambda t: ()
    segments: Callable[[float], Sequence[Segment]] = lambda t: WALLS
    noise_m: float = 0.004
    seed: int = 0
    sensors: dict[str, Sensor] = field(default_factory=lambda: {"A": Sensor(sweep(), (0.05, 0.05, math.pi / 4))})

    def scans(self, until: float, start: float = 0.0) -> Iterator[tuple[str, float, Array]]:
        """Sensor, time and ranges (n,), ten times a second."""
        rng = np.random.default_rng(self.seed)
        for k in range(round(start * 10), round(until * 10)):
            t = 0.1 * k
            for name, sensor in self.sensors.items():
                ranges = cast(sensor, self.circles(t), self.segments(t))
                yield name, t, np.round(ranges + rng.normal(0.0, self.noise_m, ranges.size), 3)

    def play(
        self,
        until: float,
        estimator: FloorEstimator | None = None,
        *,
        scene: Scene | None = None,
        settings: FloorSettings | None = None,
        start: float = 0.0,
        each: Callable[[float, FloorEstimator], None] = lambda t, estimator: None,
    ) -> tuple[FloorEstimator, list[FloorEvent]]:
        """Play it: the estimator and all events. ``each`` is called after every scan."""
        estimator = estimator or FloorEstimator(self.sensors, settings, scene)
        events: list[FloorEvent] = []
        for name, t, ranges in self.scans(until, start):
            events += estimator.scan(name, t, ranges)
            each(t, estimator)
        return estimator, events


def walker(
    way: Sequence[tuple[float, float, float]], *, leg: float = 0.05, stride_s: float = 0.5
) -> Callable[[float], tuple[Circle, ...]]:
    """Two legs of somebody who is at (x, y) at the times of ``way``: rows (t, x, y); nobody before and after."""
    times, xs, ys = (np.array(column, dtype=float) for column in zip(*way, strict=True))

    def at(t: float) -> tuple[float, float]:
        return float(np.interp(t, times, xs)), float(np.interp(t, times, ys))

    def foot(t: float, side: float) -> Circle:
        # A foot stands for one step and swings for the next; both are where the body is in the middle of the step.
        phase = t / stride_s + (1.0 if side > 0 else 0.0)
        step, share = divmod(phase, 2.0)
        begin = (2.0 * step - (1.0 if side > 0 else 0.0)) * stride_s
        here, there = at(begin + 0.5 * stride_s), at(begin + 2.5 * stride_s)
        swing = float(np.clip(share - 1.0, 0.0, 1.0))
        x, y = (a + swing * (b - a) for a, b in zip(here, there, strict=True))
        ahead = np.array(at(t + 0.3)) - np.array(at(t - 0.3))
        length = float(np.hypot(*ahead))
        ux, uy = (ahead / length).tolist() if length > 0.05 else (1.0, 0.0)
        return (x - side * 0.11 * uy, y + side * 0.11 * ux, leg)

    def circles(t: float) -> tuple[Circle, ...]:
        if not times[0] <= t <= times[-1]:
            return ()
        return foot(t, 1.0), foot(t, -1.0)

    return circles


def together(*parts: Callable[[float], Sequence[Circle]]) -> Callable[[float], list[Circle]]:
    """Everything that the parts put on the floor."""
    return lambda t: [circle for part in parts for circle in part(t)]


def thing(x: float, y: float, radius: float, since: float, until: float = math.inf) -> Callable[[float], list[Circle]]:
    """A round thing that lies there from ``since`` to ``until``."""
    return lambda t: [(x, y, radius)] if since <= t < until else []
