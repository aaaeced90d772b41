"""A robot with laser, wheels and tag reader drives through a plan of ``semidynamic_plans``: recording and truth."""

from __future__ import annotations

import gzip
import itertools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tms_agents.simulation.floor_world.raycaster import cast
from tms_agents.simulation.floor_world.shapes import Shapes
from tms_agents.simulation.semidynamic_plans import PLANS, Plan, Thing

Floats = NDArray[np.float64]
LASER = (0.12, 0.0, 0.0)
#: Nothing comes back from farther (m); beams; what the laser says then.
_REACH_M, _BEAMS, _NONE = 8.0, 361, 8.191
_SPEED, _TURN = 0.45, 0.7
_PARKED_S = 900.0


@dataclass(frozen=True, slots=True)
class Devices:
    """Laser: noise (m), share of lost beams. Wheels: errors of scale, of turning, its drift (rad/m), slips (rad) per
    s. Reader: power at 1 m above what is needed (dB), fading (dB), share of rounds in which it works, through walls
    (dB)."""

    noise_m: float = 0.012
    lost: float = 0.015
    scale: float = 0.02
    turning: float = 0.02
    pull: float = 0.004
    slips: float = 0.03
    slip_rad: float = 0.03
    power_db: float = 8.0
    fading_db: float = 2.5
    works: float = 0.8
    wall_db: float = 12.0


def record(plan_name: str, seed: int, folder: Path, devices: Devices | None = None) -> None:
    """Writes ``stream.jsonl.gz``, ``models.json`` and ``truth.json`` into ``folder``; all noise from ``seed``."""
    layout, driving, sensing = np.random.default_rng([seed, 7]).spawn(3)
    how = devices or Devices()
    plan = PLANS[plan_name](layout)
    tags = {f"E2F0{seed:04X}{number:016X}": thing for number, thing in enumerate(plan.things)}
    t, truth, legs = driven(plan)
    odometry = odometry_of(t, truth, how, driving)
    changes = _intervals(plan, t, truth, legs)
    records = [
        {"t": round(float(time), 3), "type": "odom", "x": pose[0], "y": pose[1], "theta": pose[2]}
        for time, pose in zip(t, odometry.round(5).tolist(), strict=True)
    ]
    scan_poses, reads = [], {tag: [0] * plan.passes for tag in tags}
    for n in range(0, len(t), 2):
        now = _current(changes, t[n])
        walls, owners = surfaces(plan, now)
        records.append(_scan(t[n] + 0.013, truth[n], walls, owners, how, sensing))
        scan_poses.append([round(float(t[n] + 0.013), 3), *truth[n].round(5).tolist()])
    fading = {tag: sensing.normal(0, how.fading_db, (97, 97)) for tag in tags}
    still = plan.walls
    for number, antenna in enumerate(plan.antennas):
        for time in _rounds(t, legs, number):
            pose = pose_at(t, truth, time)
            now = _current(changes, time)
            seen = []
            for index, (tag, thing) in enumerate(tags.items()):
                power = power_at(compose(pose, antenna), compose(thing.poses[now[index]], thing.tag), still, how)
                spot = (pose[:2] / 0.15).astype(int) % 97
                if power + fading[tag][spot[0], spot[1]] > 0 and sensing.random() < how.works:
                    seen.append({"id": tag, "rssi": round(-60 + 0.5 * round(2 * power), 1)})
                    reads[tag][now[index]] += 1
            records.append({"t": round(float(time), 3), "type": "rfid", "antenna": number, "tags": seen})
    records.sort(key=lambda one: one["t"])
    folder.mkdir(parents=True, exist_ok=True)
    with gzip.open(folder / "stream.jsonl.gz", "wt") as file:
        file.writelines(json.dumps(one) + "\n" for one in records)
    (folder / "models.json").write_text(json.dumps(models_of(plan, tags)))
    objects = {
        tag: {
            "label": thing.label,
            "class": thing.kind,
            "door": None if thing.closed is None else {"closed_theta": thing.closed},
            "poses": [
                {"t0": begin, "t1": end, "x": thing.poses[k][0], "y": thing.poses[k][1], "theta": thing.poses[k][2]}
                for k, (begin, end) in enumerate(changes[number])
            ],
            "reads": reads[tag],
        }
        for number, (tag, thing) in enumerate(tags.items())
    }
    spans = [[float(t[legs == leg][0]), float(t[legs == leg][-1])] for leg in np.unique(legs)]
    document = {
        "scenario": plan_name,
        "seed": seed,
        "passes": spans,
        "start_pose": truth[0].tolist(),
        "trajectory": np.column_stack([t, truth]).round(5).tolist(),
        "scan_poses": scan_poses,
        "walls": still.round(5).tolist(),
        "objects": objects,
    }
    (folder / "truth.json").write_text(json.dumps(document))


def driven(plan: Plan) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Times at 10 Hz, true poses (N, 3), number of the leg: a leg ends where the robot is parked."""
    ways = [plan.route] if plan.laps == 0 else [np.concatenate([plan.route, *[plan.route[1:]] * (plan.laps - 1)])]
    ways = ways * (1 if plan.laps else plan.passes)
    t, poses, legs, clock = [], [], [], 0.0
    for leg, way in enumerate(ways):
        heading = float(np.arctan2(*(way[1] - way[0])[::-1]))
        pose = np.array([*way[0], heading])
        steps = [pose] * 30
        for a, b in itertools.pairwise(way):
            wanted = float(np.arctan2(*(b - a)[::-1]))
            turn = (wanted - steps[-1][2] + np.pi) % (2 * np.pi) - np.pi
            count = max(1, int(abs(turn) / (0.1 * _TURN)))
            steps += [np.array([*a, steps[-1][2] + turn / count * (i + 1)]) for i in range(count)]
            count = int(np.hypot(*(b - a)) / (0.1 * _SPEED))
            sway = 0.06 * np.sin(np.linspace(0, 2 * np.pi * max(1, round(count / 80)), count + 1)[1:])
            side = np.array([-np.sin(wanted), np.cos(wanted)])
            line = a + (b - a) * (np.arange(1, count + 1) / count)[:, None] + sway[:, None] * side
            along = np.diff(np.concatenate([a[None], line]), axis=0)
            course = np.unwrap(np.concatenate([[steps[-1][2]], np.arctan2(along[:, 1], along[:, 0])]))[1:]
            steps += list(np.column_stack([line, course]))
        # Parked where the next leg begins, as it begins.
        turn = (heading - steps[-1][2] + np.pi) % (2 * np.pi) - np.pi
        count = max(1, int(abs(turn) / (0.1 * _TURN)))
        last = steps[-1]
        steps += [np.array([*way[-1], last[2] + turn / count * (i + 1)]) for i in range(count)]
        t.append(clock + 0.1 * np.arange(len(steps)))
        poses.append(np.array(steps))
        legs.append(np.full(len(steps), leg))
        clock = t[-1][-1] + _PARKED_S
    return np.concatenate(t), np.concatenate(poses), np.concatenate(legs)


def odometry_of(t: Floats, truth: Floats, how: Devices, random: np.random.Generator) -> Floats:
    scale, turning = 1 + random.normal(0, how.scale), 1 + random.normal(0, how.turning)
    pull = random.normal(0, how.pull)
    pose, found = np.zeros(3), [np.zeros(3)]
    for a, b in itertools.pairwise(truth):
        c, s = np.cos(a[2]), np.sin(a[2])
        dx, dy = b[:2] - a[:2]
        along, across = c * dx + s * dy, c * dy - s * dx
        turn = (b[2] - a[2] + np.pi) % (2 * np.pi) - np.pi
        way = float(np.hypot(along, across))
        if way + abs(turn) > 1e-9:
            turn = (
                turning * turn + pull * way + random.normal(0, 0.02 * np.sqrt(abs(turn)) * 0.3 + 0.004 * np.sqrt(way))
            )
            along = scale * along + random.normal(0, 0.02 * np.sqrt(way) * 0.5)
            if random.uniform() < how.slips * 0.1:
                turn += random.normal(0, how.slip_rad)
        else:
            turn = along = across = 0.0
        middle = pose[2] + turn / 2
        c, s = np.cos(middle), np.sin(middle)
        pose = pose + np.array([c * along - s * across, s * along + c * across, turn])
        found.append(pose)
    return np.array(found)


def _intervals(plan: Plan, t: Floats, truth: Floats, legs: NDArray[np.int64]) -> list[list[tuple[float, float]]]:
    """Per thing the spans of its poses: it moves while the robot is parked, or farther away than 10 m."""
    found = []
    for thing in plan.things:
        cuts = [-1.0]
        for k in range(1, plan.passes):
            if plan.laps == 0:
                before, after = t[legs == k - 1][-1], t[legs == k][0]
                cuts.append(float((before + after) / 2))
            else:
                away = np.hypot(*(truth[:, :2] - thing.poses[0][:2]).T) > 10.0
                span = (t > t[-1] * (k / plan.passes - 0.25)) & (t < t[-1] * (k / plan.passes + 0.25)) & away
                runs = np.split(np.flatnonzero(span), np.flatnonzero(np.diff(np.flatnonzero(span)) > 1) + 1)
                longest = max(runs, key=len)
                cuts.append(float(t[longest[len(longest) // 2]]))
        found.append([(a, b) for a, b in itertools.pairwise([*cuts, float(t[-1]) + 1.0])])
    return found


def _current(changes: list[list[tuple[float, float]]], t: float) -> list[int]:
    return [next(k for k, (begin, end) in enumerate(spans) if begin <= t < end) for spans in changes]


def surfaces(plan: Plan, now: list[int]) -> tuple[Floats, NDArray[np.int64]]:
    pieces = [plan.walls]
    for thing, k in zip(plan.things, now, strict=True):
        for part in thing.parts:
            corners = _moved(thing.poses[k], part)
            pieces.append(np.column_stack([corners, np.roll(corners, -1, axis=0)]))
    return np.concatenate(pieces), np.concatenate([np.full(len(p), n - 1) for n, p in enumerate(pieces)])


def _scan(
    t: float, pose: Floats, walls: Floats, owners: NDArray[np.int64], how: Devices, random: np.random.Generator
) -> dict[str, Any]:
    still = np.column_stack([walls, np.zeros((len(walls), 2))])
    none = np.zeros((0, 5)), np.zeros(0, dtype=np.int64), np.zeros((0, 3))
    shapes = Shapes(still, np.full(len(walls), -1, dtype=np.int64), np.zeros((len(walls), 3)), *none)
    at = compose(pose, LASER)
    step = np.pi / (_BEAMS - 1)
    met = cast(shapes, (float(at[0]), float(at[1]), float(at[2])), -np.pi / 2, step, _BEAMS, 0.0).ranges
    ranges = np.round(met + random.normal(0, how.noise_m, _BEAMS), 3)
    # The last beam of a surface sees it and what is behind.
    mixed = np.flatnonzero(np.abs(np.diff(met)) > 0.3)
    mixed = mixed[random.uniform(size=len(mixed)) < 0.15]
    ranges[mixed] = np.round(met[mixed] + random.uniform(size=len(mixed)) * (met[mixed + 1] - met[mixed]), 3)
    gone = (met > _REACH_M - 0.05) | (random.uniform(size=_BEAMS) < how.lost)
    ranges = np.where(gone, _NONE, ranges)
    return {
        "t": round(float(t), 3),
        "type": "scan",
        "angle_min": -np.pi / 2,
        "angle_increment": step,
        "range_max": _REACH_M,
        "ranges": ranges.tolist(),
    }


def _rounds(t: Floats, legs: NDArray[np.int64], number: int) -> Floats:
    """8 Hz while the robot is on."""
    spans = [(t[legs == leg][0], t[legs == leg][-1]) for leg in np.unique(legs)]
    return np.concatenate([np.arange(a + 0.031 + 0.06 * number, b, 0.125) for a, b in spans])


def power_at(antenna: Floats, tag: Floats, walls: Floats, how: Devices) -> float:
    """dB above what a tag needs: free space, a smooth lobe, a dipole that is turned away, walls between."""
    dx, dy = tag[:2] - antenna[:2]
    distance = max(float(np.hypot(dx, dy)), 0.1)
    if distance > 4.0:
        return -99.0
    bearing = (np.arctan2(dy, dx) - antenna[2] + np.pi) % (2 * np.pi) - np.pi
    facing = (np.arctan2(-dy, -dx) - tag[2] + np.pi) % (2 * np.pi) - np.pi
    lobe = -min(12.0 * (bearing / (2 * np.pi / 3)) ** 2, 18.0)
    turned = 20 * np.log10(max(np.cos(facing), 0.1)) * 0.6
    power = how.power_db - 22 * np.log10(distance) + lobe + turned
    return float(power - how.wall_db * (_crossed(antenna[:2], tag[:2], walls)))


def _crossed(a: Floats, b: Floats, walls: Floats) -> bool:
    """Whether a wall lies between (not one that is touched at the ends)."""
    d, e = b - a, walls[:, 2:] - walls[:, :2]
    cross = d[0] * e[:, 1] - d[1] * e[:, 0]
    off = walls[:, :2] - a
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (off[:, 0] * e[:, 1] - off[:, 1] * e[:, 0]) / cross
        there = (off[:, 0] * d[1] - off[:, 1] * d[0]) / cross
    return bool(((along > 0.02) & (along < 0.95) & (there > 0) & (there < 1)).any())


def models_of(plan: Plan, tags: dict[str, Thing]) -> dict[str, Any]:
    antennas = [
        {"id": n, "pose": pose, "nominal_max_range": 2.0, "nominal_half_beam": np.pi / 3}
        for n, pose in enumerate(plan.antennas)
    ]
    laser = {"nominal_sigma": 0.01, "range_max": _REACH_M, "fov_deg": 180.0, "increment_deg": 0.5}
    return {
        "robot": {"laser_pose": LASER, "antennas": antennas, "radius": 0.22, "laser": laser},
        "tags": {
            tag: {
                "class": thing.kind,
                "polygon": thing.parts[0].tolist(),
                "parts": [part.tolist() for part in thing.parts],
                "tag_pose": thing.tag,
            }
            for tag, thing in tags.items()
        },
    }


def pose_at(t: Floats, poses: Floats, time: float) -> Floats:
    turns = np.unwrap(poses[:, 2])
    return np.array([np.interp(time, t, poses[:, 0]), np.interp(time, t, poses[:, 1]), np.interp(time, t, turns)])


def compose(pose: Any, part: Any) -> Floats:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([pose[0] + c * part[0] - s * part[1], pose[1] + s * part[0] + c * part[1], pose[2] + part[2]])


def _moved(pose: Any, points: Floats) -> Floats:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.stack([pose[0] + c * points[:, 0] - s * points[:, 1], pose[1] + s * points[:, 0] + c * points[:, 1]], -1)
