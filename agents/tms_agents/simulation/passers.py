"""People in the way of a robot that drives through a building: they cross, come towards it, go before it, stand and go.

They come out of walls and go into them as through doors: what is behind a wall is not seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Speeds (m/s) people walk at, length (m) of a double step, how far (m) a foot swings and stands from the middle.
_SPEED, _STRIDE_M, _SWING_M, _STANCE_M = (0.9, 1.5), 1.4, 0.3, 0.1
#: Radius (m) of a leg and of a body.
_LEG_M, _BODY_M = 0.065, 0.22
#: They leave through the nearest wall, so far (m) from the middle of the corridor.
_AWAY_M = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Passer:
    """At ``places`` (K, 2) m at ``times`` (K,) s, on straight lines between; nowhere before and after.

    A laser near the floor sees two legs, a higher one a body.
    """

    times: Floats
    places: Floats
    legs: bool

    def circles(self, t: float) -> Floats:
        """(C, 3) x, y, radius in the plane of the laser; none if they are not there."""
        if not self.times[0] <= t <= self.times[-1]:
            return np.zeros((0, 3))
        middle = self._at(t)
        if not self.legs:
            return np.array([[*middle, _BODY_M]])
        ahead = self._at(t + 0.2) - self._at(t - 0.2)
        way = np.hypot(*ahead)
        along = ahead / way if way > 1e-6 else np.array([1.0, 0.0])
        walked = np.interp(t, self.times, np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.places, axis=0).T))]))
        swing = _SWING_M * np.sin(2 * np.pi * walked / _STRIDE_M) * (way > 1e-6)
        across = _STANCE_M * np.array([-along[1], along[0]])
        return np.array([[*(middle + side * (across + swing * along)), _LEG_M] for side in (1.0, -1.0)])

    def _at(self, t: float) -> Floats:
        return np.array([np.interp(t, self.times, column) for column in self.places.T])


def passers(t: Floats, truth: Floats, per_10_m: float, legs: bool, generator: np.random.Generator) -> list[Passer]:
    """People met on the way ``truth`` (S, 3) at times ``t`` (S,), so many per 10 m, of the four kinds in turn."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(truth[:, :2], axis=0).T))])
    robot = _Way(t, truth, way)
    kinds = (_crossing, _oncoming, _ahead, _standing)
    count = round(per_10_m * way[-1] / 10.0)
    return [Passer(*kinds[n % len(kinds)](robot, float(s), generator), legs) for n, s in enumerate(
        generator.uniform(4.0, max(4.0, way[-1] - 8.0), count)
    )]  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """Of the robot: times (S,), poses (S, 3), way (S,) m until then."""

    t: Floats
    poses: Floats
    way: Floats

    def time(self, s: float) -> float:
        """When it has driven ``s`` m."""
        return float(np.interp(s, self.way, self.t))

    def beside(self, s: Floats, across: Floats) -> Floats:
        """(K, 2) places ``across`` m to the left of where it is after ``s`` (K,) m."""
        x, y = (np.interp(s, self.way, column) for column in self.poses[:, :2].T)
        heading = np.interp(s, self.way, np.unwrap(self.poses[:, 2]))
        return np.column_stack([x - across * np.sin(heading), y + across * np.cos(heading)])


def _crossing(robot: _Way, s: float, generator: np.random.Generator) -> tuple[Floats, Floats]:
    """From wall to wall, some metres before the robot."""
    ahead, side, speed = generator.uniform(1.5, 6.0), generator.choice([-1.0, 1.0]), generator.uniform(*_SPEED)
    across = np.array([side * _AWAY_M, -side * _AWAY_M])
    places = robot.beside(np.full(2, s + ahead) + np.array([0.0, generator.uniform(-1.0, 1.0)]), across)
    return _timed(robot.time(s), places, speed)


def _oncoming(robot: _Way, s: float, generator: np.random.Generator) -> tuple[Floats, Floats]:
    """Towards the robot and past it."""
    ahead, across = generator.uniform(6.0, 15.0), generator.choice([-1.0, 1.0]) * generator.uniform(0.5, 0.8)
    ways = np.arange(s + ahead, max(0.0, s - 6.0), -0.5)
    return _timed(robot.time(s), robot.beside(ways, np.full(len(ways), across)), generator.uniform(*_SPEED))


def _ahead(robot: _Way, s: float, generator: np.random.Generator) -> tuple[Floats, Floats]:
    """As fast as the robot, two metres before or a little beside it, then off through a wall."""
    lead, across, long = generator.uniform(1.0, 3.0), generator.uniform(-0.7, 0.7), generator.uniform(5.0, 15.0)
    ways = np.arange(s, s + long, 0.25)
    times = np.interp(ways, robot.way, robot.t)
    places = robot.beside(ways + lead, np.full(len(ways), across))
    return _leaving(times, places, robot.beside(ways[-1:] + lead, np.array([np.copysign(_AWAY_M, across)])))


def _standing(robot: _Way, s: float, generator: np.random.Generator) -> tuple[Floats, Floats]:
    """Comes through a wall, stands beside the robot's way for a while, goes on."""
    ahead, side, long = generator.uniform(2.0, 6.0), generator.choice([-1.0, 1.0]), generator.uniform(3.0, 20.0)
    ways = np.full(3, s + ahead)
    places = robot.beside(ways, side * np.array([_AWAY_M, 0.7, 0.7]))
    start, arrived = _timed(robot.time(s), places[:2], generator.uniform(*_SPEED))[0]
    times = np.array([start, arrived, arrived + long])
    return _leaving(times, places, robot.beside(ways[:1], side * np.array([_AWAY_M])))


def _timed(start: float, places: Floats, speed: float) -> tuple[Floats, Floats]:
    return start + np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))]) / speed, places


def _leaving(times: Floats, places: Floats, door: Floats) -> tuple[Floats, Floats]:
    away = float(np.hypot(*(door[0] - places[-1])))
    return np.append(times, times[-1] + away), np.concatenate([places, door])
