"""A robot with wheels and a laser that tells received light, driven through one of the `coloured` places.

The laser: light falls with range and with the cosine of the incidence to a power, less so near by, is bent by the
amplifier, differs from beam to beam, is noisy and counted in coarse steps. Dark surfaces seem farther away and are
missed more often.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from tms_agents.simulation.building import Floats, path_through
from tms_agents.simulation.coloured import PLACES, Place
from tms_agents.simulation.floor_world.raycaster import cast
from tms_agents.simulation.floor_world.shapes import Shapes

_SPEED, _TURN_SPEED, _REST_S = 0.45, 0.7, 2.0
LASER = (0.15, 0.0, 0.0)
_FIRST, _STEP, _BEAMS, _FARTHEST = np.radians(-120.0), np.radians(0.5), 481, 4.5
_GAIN, _NEAR_M, _POWER, _BENT, _COUNT = 9000.0, 0.8, 0.7, 0.85, 8.0
_NOISE, _UNEVEN = 0.06, 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """``lines`` of a recording (``.jsonl``), its ``models.json``; ``t`` (S,) and ``truth`` (S, 3) of the scans."""

    lines: list[str]
    models: str
    t: Floats
    truth: Floats
    odometry: Floats
    walls: Floats


def record(name: str, seed: int) -> Recording:
    """A drive through the place ``name`` of `PLACES`; everything is drawn from ``seed``."""
    random = np.random.default_rng([seed, list(PLACES).index(name)])
    return drive_through(PLACES[name](random), random)


def drive_through(place: Place, random: np.random.Generator) -> Recording:
    """The whole way through ``place``."""
    t, truth = _driven(path_through(place.way, random))
    rolled = _rolled(truth, place, random)
    lines = []
    for a, (x, y, theta) in zip(t.tolist(), rolled.tolist(), strict=True):
        pose = {"x": round(x, 5), "y": round(y, 5), "theta": round(theta, 6)}
        lines.append((a, json.dumps({"t": round(a, 3), "type": "odom", **pose})))
    scans = np.arange(0.04, t[-1], 0.2)
    poses = _at(t, truth, scans)
    gains = np.exp(random.normal(0.0, _UNEVEN, _BEAMS))
    shapes = _shapes(place.walls)
    for a, seen_from in zip(scans.tolist(), poses, strict=True):
        ranges, light = _scan(shapes, seen_from, gains, random)
        scan = {
            "t": round(a, 3), "type": "scan", "angle_min": _FIRST, "angle_increment": _STEP,
            "range_max": _FARTHEST, "ranges": ranges.tolist(), "intensities": light.tolist(),
        }  # fmt: skip
        lines.append((a, json.dumps(scan)))
    lines.sort(key=lambda one: one[0])
    models = json.dumps({"robot": {"laser_pose": LASER}, "tags": {}})
    return Recording([line for _, line in lines], models, scans, poses, _at(t, rolled, scans), place.walls)


def _driven(fine: Floats) -> tuple[Floats, Floats]:
    """(times, poses) ten times a second, after a rest at the start."""
    way = np.hypot(*np.diff(fine[:, :2], axis=0).T) / _SPEED
    turn = np.abs(np.diff(fine[:, 2])) / _TURN_SPEED
    at = _REST_S + np.concatenate([[0.0], np.cumsum(np.maximum(np.maximum(way, turn), 1e-6))])
    t = np.arange(0.0, at[-1], 0.1)
    return t, _at(at, fine, t)


def _at(times: Floats, poses: Floats, t: Floats) -> Floats:
    """Poses (N, 3) with headings that do not wrap, at the times ``t``."""
    return np.stack([np.interp(t, times, column) for column in (*poses[:, :2].T, np.unwrap(poses[:, 2]))], axis=-1)


def _rolled(truth: Floats, place: Place, chance: np.random.Generator) -> Floats:
    """What the wheels say, from (0, 0, 0) on; ``place.off`` tells how wrong they are where they are most."""
    steps = np.diff(truth, axis=0)
    way = np.hypot(steps[:, 0], steps[:, 1])
    wrong = np.stack(
        [
            way * chance.uniform(-0.045, 0.045) + np.sqrt(way) * chance.normal(0.0, 0.01, len(way)),
            steps[:, 2] * chance.uniform(-0.05, 0.05)
            + way * chance.uniform(0.0015, 0.003) * chance.choice([-1.0, 1.0])
            + np.sqrt(way) * chance.normal(0.0, 0.004, len(way)),
        ]
    )
    if place.off is None:
        return _summed(truth, way + wrong[0], steps[:, 2] + wrong[1])
    little, much = 0.0, 10.0
    for _ in range(40):
        factor = (little + much) / 2
        rolled = _summed(truth, way + factor * wrong[0], steps[:, 2] + factor * wrong[1])
        error = _seen_from_start(truth)[:, :2] - rolled[:, :2]
        little, much = (factor, much) if np.hypot(*error.T).max() < place.off else (little, factor)
    return rolled


def _summed(truth: Floats, way: Floats, turn: Floats) -> Floats:
    """Steps put together; they go where the robot looked, halfway through its turn."""
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    middle = heading[:-1] + turn / 2
    x, y = np.cumsum(way * np.cos(middle)), np.cumsum(way * np.sin(middle))
    return np.column_stack([np.concatenate([[0.0], x]), np.concatenate([[0.0], y]), heading])


def _seen_from_start(truth: Floats) -> Floats:
    c, s = np.cos(truth[0, 2]), np.sin(truth[0, 2])
    x, y = (truth[:, :2] - truth[0, :2]).T
    return np.column_stack([c * x + s * y, c * y - s * x])


def _scan(shapes: Shapes, pose: Floats, gains: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
    """(ranges m, 0 where nothing came back, intensities) of one scan."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    laser = (
        pose[0] + c * LASER[0] - s * LASER[1],
        pose[1] + s * LASER[0] + c * LASER[1],
        float(np.arctan2(s, c)) + LASER[2],
    )
    met = cast(shapes, laser, float(_FIRST), float(_STEP), _BEAMS, 0.0)
    ranges = np.where(np.isfinite(met.ranges), met.ranges, _FARTHEST)
    falls = 1.0 / ((ranges / _NEAR_M) ** 2 + 1.0) ** 0.9
    received = met.reflectivity * (0.1 + 0.9 * np.maximum(met.cosines, 0.0) ** _POWER) * falls * gains
    light = _GAIN * received**_BENT * np.exp(random.normal(0.0, _NOISE, _BEAMS))
    noisy = ranges + random.normal(0.0, np.maximum(0.01, 0.01 * ranges)) + 0.012 * (0.5 - met.reflectivity)
    missed = random.uniform(size=_BEAMS) < 0.01 + 0.1 * (received < 0.004)
    valid = (met.ranges < _FARTHEST - 0.05) & ~missed
    return np.where(valid, np.round(noisy, 3), 0.0), np.where(valid, _COUNT * np.round(light / _COUNT), 0.0)


def _shapes(walls: Floats) -> Shapes:
    count = len(walls)
    return Shapes(
        np.column_stack([walls[:, :4], np.zeros((count, 2))]),
        np.full(count, -1, dtype=np.int64),
        np.column_stack([walls[:, 4], np.ones(count), np.zeros(count)]),
        np.zeros((0, 5)),
        np.zeros(0, dtype=np.int64),
        np.zeros((0, 3)),
    )
