"""Long corridors with loops, and a robot with wheels and a laser that drives through them: worlds to test mapping on.

Floor plans are unions of rectangles (corridors, door recesses, rooms); walls are the edges of the union.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.simulation.floor_world.raycaster import cast
from tms_agents.simulation.floor_world.shapes import NOBODY, Shapes
from tms_agents.simulation.passers import passers

Floats = NDArray[np.float64]
#: What the laser says where nothing comes back (m).
NO_RETURN = 81.83
_PERSON = 0
Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Drive:
    """``width`` of the corridors and lengths in m. ``doors`` is the distance of doors; ``irregular`` the share of it
    by which they are misplaced, ``rooms`` the share of doors that are open.

    The wheels: deviation of the turn per root of m driven (rad) and per rad, its constant part per m, deviation of the
    way per root of m. The laser: noise and longest range (m), share of beams that are lost, beams over half a turn.

    ``people`` are met per 10 m of way, seen as ``legs`` or as bodies.
    """

    seed: int = 0
    width: float = 2.4
    doors: float = 4.0
    irregular: float = 0.3
    rooms: float = 0.15
    turn_per_m: float = 0.02
    turn_per_rad: float = 0.05
    pull_per_m: float = 0.001
    way_per_m: float = 0.03
    step_m: float = 0.8
    step_rad: float = 0.4
    noise_m: float = 0.015
    range_max: float = 50.0
    lost: float = 0.02
    beams: int = 180
    people: float = 0.0
    legs: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """``t`` (S,) s, ``truth`` and ``odometry`` (S, 3), ``ranges`` (S, B) m (`NO_RETURN` where none) at ``angles``
    (B,); ``people`` (S, B) which beams met a person."""

    t: Floats
    truth: Floats
    odometry: Floats
    ranges: Floats
    angles: Floats
    walls: Floats
    people: NDArray[np.bool_]


#: Corners of the corridors' middle lines, which of them corridors join, and the way from corner to corner.
Plan = tuple[list[tuple[float, float]], list[tuple[int, int]], list[int]]
PLANS: dict[str, Plan] = {
    # A small ring, driven twice: quick.
    "block": (
        [(0, 0), (24, 0), (24, 12), (0, 12)],
        [(0, 1), (1, 2), (2, 3), (3, 0)],
        [0, 1, 2, 3, 0, 1, 2, 3, 0],
    ),
    # A ring of 320 m, driven twice.
    "ring": (
        [(0, 0), (110, 0), (110, 50), (0, 50)],
        [(0, 1), (1, 2), (2, 3), (3, 0)],
        [0, 1, 2, 3, 0, 1, 2, 3, 0],
    ),
    # Three blocks side by side with a wing, 1.9 km: every loop is closed only after 300 m and more.
    "campus": (
        [(0, 0), (80, 0), (160, 0), (220, 0), (220, 70), (160, 70), (80, 70), (0, 70), (-40, 0), (160, 130), (80, 130)],
        [
            (0, 1),
            (1, 2),
            (2, 3),
            (3, 4),
            (4, 5),
            (5, 6),
            (6, 7),
            (7, 0),
            (1, 6),
            (2, 5),
            (8, 0),
            (5, 9),
            (9, 10),
            (10, 6),
        ],
        [8, 0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 6, 10, 9, 5, 2, 1, 6, 5, 4, 3, 2, 5, 9, 10, 6, 7, 0, 8, 0, 1, 2],
    ),
    # One long corridor there and back with a small ring at its end: nothing but doors to tell places apart.
    "spine": (
        [(0, 0), (200, 0), (200, 30), (230, 30), (230, 0), (100, 0), (100, -40), (0, -40)],
        [(0, 5), (5, 1), (1, 2), (2, 3), (3, 4), (4, 1), (5, 6), (6, 7), (7, 0)],
        [0, 5, 1, 2, 3, 4, 1, 5, 6, 7, 0, 5, 1, 4, 3, 2, 1, 5, 0, 7, 6, 5, 1],
    ),
}


def drive(plan: str | Plan, how: Drive) -> Driven:
    """The whole way through one of `PLANS`, or another one, with all noise drawn from ``how.seed``."""
    random = np.random.default_rng(how.seed)
    corners, corridors, way = PLANS[plan] if isinstance(plan, str) else plan
    points = np.array(corners, dtype=np.float64)
    walls = edges(_rectangles(points, corridors, how, random))
    fine = path_through(points[way], random)
    truth, odometry = _rolled(fine, how, random)
    angles = -np.pi / 2 + np.pi / how.beams * np.arange(float(how.beams))
    t = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(truth[:, :2], axis=0).T) + 0.2)]) / 0.5
    # People are drawn apart: the same building and drive with and without them.
    around = passers(t, truth, how.people, how.legs, np.random.default_rng([how.seed, 1]))
    ranges, people = np.empty((len(truth), how.beams)), np.zeros((len(truth), how.beams), dtype=bool)
    for n, pose in enumerate(truth):
        circles = np.concatenate([np.zeros((0, 3)), *(one.circles(float(t[n])) for one in around)])
        # A tour winds round and round; the caster knows two turns.
        seen_from = (pose[0], pose[1], (pose[2] + np.pi) % (2 * np.pi) - np.pi)
        met = cast(_shapes(walls, circles), seen_from, float(angles[0]), np.pi / how.beams, how.beams, 0.0)
        noisy = np.round(met.ranges + random.normal(0, how.noise_m, how.beams), 2)
        returned = (met.ranges < how.range_max) & (random.uniform(0.0, 1.0, how.beams) >= how.lost)
        ranges[n] = np.where(returned, noisy, NO_RETURN)
        people[n] = returned & (met.owners == _PERSON)
    return Driven(t, truth, odometry, ranges, angles, walls, people)


def edges(rectangles: list[Rectangle]) -> Floats:
    """(W, 4) x0, y0, x1, y1 of the outline of the union of rectangles (x0, y0, x1, y1)."""
    boxes = np.array(rectangles)
    xs, ys = np.unique(boxes[:, [0, 2]].round(6)), np.unique(boxes[:, [1, 3]].round(6))
    inside = np.zeros((len(ys) + 1, len(xs) + 1), dtype=bool)
    for x0, y0, x1, y1 in boxes.round(6):
        i0, i1 = np.searchsorted(xs, [x0, x1])
        j0, j1 = np.searchsorted(ys, [y0, y1])
        inside[j0 + 1 : j1 + 1, i0 + 1 : i1 + 1] = True
    walls = []
    for i in range(len(xs)):
        walls += [(xs[i], ys[a], xs[i], ys[b]) for a, b in _runs((inside[:, i] != inside[:, i + 1])[1:-1])]
    for j in range(len(ys)):
        walls += [(xs[a], ys[j], xs[b], ys[j]) for a, b in _runs((inside[j] != inside[j + 1])[1:-1])]
    return np.array(walls)


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first, end) of the runs of true."""
    changes = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return list(zip(changes[::2].tolist(), changes[1::2].tolist(), strict=True))


def _rectangles(
    points: Floats, corridors: list[tuple[int, int]], how: Drive, random: np.random.Generator
) -> list[Rectangle]:
    half = how.width / 2
    found: list[Rectangle] = []
    for a, b in corridors:
        low, high = np.minimum(points[a], points[b]), np.maximum(points[a], points[b])
        found.append((low[0] - half, low[1] - half, high[0] + half, high[1] + half))
        level = int(high[0] - low[0] > high[1] - low[1])  # 1: along x
        along, across = (0, 1) if level else (1, 0)
        for side in (-1, 1):
            for place in np.arange(low[along] + 3.0, high[along] - 3.0, how.doors):
                middle = place + random.uniform(-0.5, 0.5) * how.irregular * how.doors
                deep = random.uniform(0.1, 0.3)
                edge = low[across] + side * half
                found.append(_beside(middle, 0.5, edge, side * deep, along))
                if random.uniform() < how.rooms:
                    size, long = random.uniform(1.2, 1.9), random.uniform(2.5, 5.0)
                    found.append(_beside(middle, 0.45, edge, side * (deep + 0.1), along))
                    found.append(_beside(middle, size, edge + side * (deep + 0.1), side * long, along))
    return found


def _beside(middle: float, half: float, edge: float, deep: float, along: int) -> Rectangle:
    """A rectangle from ``edge`` on, ``deep`` across and twice ``half`` along the corridor."""
    near, far = min(edge, edge + deep), max(edge, edge + deep)
    if along == 0:
        return middle - half, near, middle + half, far
    return near, middle - half, far, middle + half


def path_through(corners: Floats, random: np.random.Generator) -> Floats:
    """(F, 3) poses every few centimetres, corners cut, weaving a little; where the way turns back, on the spot."""
    pieces = [corners[:1]]
    for a, b in itertools.pairwise(corners):
        count = int(np.hypot(*(b - a)) / 0.05)
        pieces.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    line = np.concatenate(pieces)
    kernel = np.hanning(41)
    kernel /= kernel.sum()
    wander = np.convolve(random.normal(0, 1, len(line) + 400), np.hanning(401), "valid")
    padded = np.pad(line, ((20, 20), (0, 0)), mode="edge")
    smooth = np.stack([np.convolve(padded[:, i], kernel, "valid") for i in range(2)], axis=-1)
    heading = np.unwrap(np.arctan2(*np.gradient(smooth, axis=0).T[::-1]))
    offset = 0.1 * wander[: len(line)] / np.std(wander)
    smooth += offset[:, None] * np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    heading = np.unwrap(np.arctan2(*np.gradient(smooth, axis=0).T[::-1]))
    return _with_turns(np.column_stack([smooth, heading]))


def _with_turns(poses: Floats) -> Floats:
    """No two poses more than 0.1 rad apart: a robot that turns back does so on the spot, bit by bit."""
    pieces = [poses[:1]]
    for a, b in itertools.pairwise(poses):
        count = max(1, int(abs(b[2] - a[2]) / 0.1) + 1)
        pieces.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(pieces)


def _rolled(fine: Floats, how: Drive, random: np.random.Generator) -> tuple[Floats, Floats]:
    """(truth, odometry) (S, 3) where a scan is taken: every so many m or rad."""
    truth, odometry = [fine[0]], [fine[0].copy()]
    pose, since = fine[0].copy(), np.zeros(2)
    for a, b in itertools.pairwise(fine):
        dx, dy, turn = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        along, across = np.cos(a[2]) * dx + np.sin(a[2]) * dy, np.cos(a[2]) * dy - np.sin(a[2]) * dx
        way = np.hypot(dx, dy)
        scale = 1.0 + random.normal() * how.way_per_m / max(np.sqrt(way), 1e-3)
        wrong = random.normal() * (how.turn_per_m * np.sqrt(way) + how.turn_per_rad * abs(turn)) + how.pull_per_m * way
        c, s = np.cos(pose[2]), np.sin(pose[2])
        pose = pose + np.array([scale * (c * along - s * across), scale * (s * along + c * across), turn + wrong])
        since += (way, abs(turn))
        if since[0] >= how.step_m or since[1] >= how.step_rad:
            truth.append(b)
            odometry.append(pose)
            since[:] = 0.0
    return np.array(truth), np.array(odometry)


def _shapes(walls: Floats, people: Floats) -> Shapes:
    still = np.column_stack([walls, np.zeros((len(walls), 2))])
    return Shapes(
        still,
        np.full(len(walls), NOBODY, dtype=np.int64),
        np.zeros((len(walls), 3)),
        np.column_stack([people, np.zeros((len(people), 2))]),
        np.full(len(people), _PERSON, dtype=np.int64),
        np.zeros((len(people), 3)),
    )


def carmen(driven: Driven) -> list[str]:
    """The drive as lines of a CARMEN log."""
    lines = ["# a simulated drive"]
    for t, (x, y, theta), ranges in zip(driven.t, driven.odometry, driven.ranges, strict=True):
        pose = f"{x:.6f} {y:.6f} {theta:.6f}"
        lines.append(f"ODOM {pose} 0 0 0 {t:.6f} simulated {t:.6f}")
        readings = " ".join(f"{r:.2f}" for r in ranges)
        lines.append(f"FLASER {len(ranges)} {readings} {pose} {pose} {t:.6f} simulated {t:.6f}")
    return lines
