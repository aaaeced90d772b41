"""Localisation in known maps from anywhere: how often right, how soon, how often wrong; kidnapped robots; CPU time.

    python benchmarks/localise.py                              all worlds
    python benchmarks/localise.py --worlds intel,csail-part      some of them
    python benchmarks/localise.py --starts 20 --seeds 2
    python benchmarks/localise.py --plain                      with settings like those of AMCL

Maps are made by `tms_agents.slam.build_map`: of the whole log, or (`-part`) of its first half, and then the robot is
put into the second half; what drives there is compared with the path of the whole log (logs) or the truth (simulated),
laid over the map by the poses of the first half. A start counts as covered where the map knows what half of the beams
see. Recorded data is read from the shared data folder (`TMS_SHARED_DATA`).
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numba
import numpy as np

from tms_agents.simulation.building import Drive, carmen, drive
from tms_agents.slam import Log, Settings, build_map, read_log
from tms_agents.slam.fit import UNKNOWN, Fit
from tms_agents.slam.geometry import Floats, between, compose, inverse
from tms_agents.slam.keyframes import Indices, key_scans
from tms_agents.slam.known import KnownMap, known_map
from tms_agents.slam.localisation import Estimate, Localiser
from tms_agents.slam.localisation_settings import LocalisationSettings
from tms_agents.slam.logs_carmen import parse_carmen

DATA = Path(os.environ.get("TMS_SHARED_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
RIGHT_M, RIGHT_RAD = 0.5, np.radians(10)
#: Scans until a robot is said not to have found itself, and that are followed after it has.
PATIENCE, FOLLOWED = 150, 60
#: What AMCL does: particles over the map as they come, only weighed by where beams end near walls, 5000 at most.
PLAIN = LocalisationSettings(particles=5000, tries_per_m2=0.0, matched=0, through=False)


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """``reference`` (K, 3) in the frame of ``known`` at the key scans ``keys`` of ``log``; starts from key ``first``
    on."""

    name: str
    log: Log
    keys: Indices
    known: KnownMap
    reference: Floats
    first: int = 0


@dataclass(slots=True)
class Trial:
    """``outcome`` right, wrong or none; ``driven_m`` until then; errors after it; ``kidnapped`` likewise, if tried."""

    covered: bool
    outcome: str
    driven_m: float = np.nan
    errors: list[float] = field(default_factory=list)
    false_scans: int = 0
    kidnapped: str = ""
    back_m: float = np.nan
    ms: list[float] = field(default_factory=list)
    tracking_ms: list[float] = field(default_factory=list)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", default=",".join(WORLDS), help="comma separated")
    parser.add_argument("--starts", type=int, default=12, help="moments at which the robot is put into the map")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--plain", action="store_true", help="with settings like those of AMCL")
    args = parser.parse_args(arguments)
    if unknown := set(args.worlds.split(",")) - set(WORLDS):
        parser.error(f"no world {', '.join(sorted(unknown))}; there are {', '.join(WORLDS)}")
    numba.set_num_threads(1)
    print(HEADER)
    for name in args.worlds.split(","):
        world = WORLDS[name](name)
        if world is None:
            print(f"| {name}: no recording at {DATA} (TMS_SHARED_DATA) |")
            continue
        print(row(world, trials(world, args.starts, args.seeds, PLAIN if args.plain else LocalisationSettings())))


HEADER = (
    "| world | free m2 | starts | right | wrong | not (covered starts) | elsewhere: not said, right, wrong "
    "| m driven, median (90 %) | error m, median (95 %) | scans that said wrong | kidnapped: back, wrong, not "
    "| ms/scan all, tracking |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
)


def row(world: World, found: list[Trial]) -> str:
    inside = [trial for trial in found if trial.covered]
    outside = [trial for trial in found if not trial.covered]

    def share(outcome: str) -> str:
        return f"{100 * np.mean([trial.outcome == outcome for trial in inside]):.0f} %" if inside else "-"

    def number(outcome: str) -> int:
        return sum(trial.outcome == outcome for trial in outside)

    ways = [trial.driven_m for trial in found if trial.outcome == "right"]
    errors = [error for trial in found for error in trial.errors]
    after = sum(len(trial.errors) + trial.false_scans for trial in found)
    back = [sum(trial.kidnapped == outcome for trial in found) for outcome in ("right", "wrong", "none")]
    return (
        f"| {world.name} | {world.known.free_m2:.0f} | {len(inside)} + {len(outside)} | {share('right')} "
        f"| {share('wrong')} | {share('none')} | {number('none')}, {number('right')}, {number('wrong')} "
        f"| {_two(ways, 90, '.1f')} | {_two(errors, 95, '.3f')} "
        f"| {sum(trial.false_scans for trial in found)} of {after} "
        f"| {back[0]}, {back[1]}, {back[2]} | {np.mean([ms for t in found for ms in t.ms]):.1f}, "
        f"{np.mean([ms for t in found for ms in t.tracking_ms] or [np.nan]):.1f} |"
    )


def _two(values: list[float], quantile: float, form: str) -> str:
    return f"{np.median(values):{form}} ({np.percentile(values, quantile):{form}})" if values else "-"


def trials(world: World, starts: int, seeds: int, settings: LocalisationSettings) -> list[Trial]:
    last = len(world.keys) - 10
    places = np.linspace(world.first, last, starts, endpoint=False).astype(int)
    return [
        trial(world, int(start), int(places[(n + len(places) // 2) % len(places)]), replace(settings, seed=seed))
        for seed in range(seeds)
        for n, start in enumerate(places)
    ]


def trial(world: World, start: int, other: int, settings: LocalisationSettings) -> Trial:
    """Put in at key ``start``; once it has found itself and gone on, carried to ``other``, where its wheels do not
    notice."""
    robot = _Robot(world, settings)
    done = Trial(_covered(world, start), "none")
    at = start
    for at in range(start, min(start + PATIENCE, len(world.keys))):
        estimate = robot.at(at, done)
        if estimate.localised:
            done.outcome = "right" if robot.right(at, estimate) else "wrong"
            done.driven_m = robot.driven(start, at)
            break
    else:
        return done
    followed = at
    for followed in range(at + 1, min(at + 1 + FOLLOWED, len(world.keys))):
        estimate = robot.at(followed, done, tracking=True)
        if estimate.localised and robot.right(followed, estimate):
            done.errors.append(robot.error(followed, estimate)[0])
        done.false_scans += estimate.localised and not robot.right(followed, estimate)
    if done.outcome == "wrong" or not _covered(world, other):
        return done
    robot.carried(followed, other)
    done.kidnapped = "none"
    for at in range(other, min(other + PATIENCE, len(world.keys))):
        estimate = robot.at(at, Trial(True, ""))
        if estimate.localised and at > other + 10:
            done.kidnapped = "right" if robot.right(at, estimate) else "wrong"
            if done.kidnapped == "right":
                break
    return done


class _Robot:
    """Feeds a localiser from the log; after it was carried away its odometry goes on as if nothing had happened."""

    def __init__(self, world: World, settings: LocalisationSettings) -> None:
        self._world = world
        self._localiser = Localiser(world.known, settings, world.log.laser)
        self._shift, self._way = np.zeros(3), np.zeros(2)

    def at(self, key: int, trial: Trial, *, tracking: bool = False) -> Estimate:
        log, n = self._world.log, int(self._world.keys[key])
        began = time.process_time()
        estimate = self._localiser.process(
            compose(self._shift, log.odometry[n]), log.driven[n] + self._way, log.points(n)
        )
        spent = 1000 * (time.process_time() - began)
        trial.ms.append(spent)
        if tracking:
            trial.tracking_ms.append(spent)
        return estimate

    def carried(self, key: int, other: int) -> None:
        log = self._world.log
        before, after = int(self._world.keys[key]), int(self._world.keys[other])
        self._shift = compose(compose(self._shift, log.odometry[before]), inverse(log.odometry[after]))
        self._way = log.driven[before] + self._way - log.driven[after]

    def error(self, key: int, estimate: Estimate) -> tuple[float, float]:
        x, y, turn = between(self._world.reference[key], estimate.best.pose)
        return float(np.hypot(x, y)), float(abs(turn))

    def right(self, key: int, estimate: Estimate) -> bool:
        metres, turn = self.error(key, estimate)
        return metres < RIGHT_M and turn < RIGHT_RAD

    def driven(self, start: int, key: int) -> float:
        keys, driven = self._world.keys, self._world.log.driven[:, 0]
        return float(driven[keys[key]] - driven[keys[start]])


def _covered(world: World, start: int) -> bool:
    log = world.log
    points = log.points(int(world.keys[start]))
    fit = Fit(world.known, 0.1)(world.reference[start][None], points, log.laser[:2])
    return bool(fit[0, UNKNOWN] < 0.5)


def whole(log: Log) -> tuple[KnownMap, Indices, Floats]:
    """(map, key scans, path there) of all of a log."""
    result = build_map(log, Settings())
    grid = result.grid
    return known_map(grid.probabilities(), grid.origin, grid.resolution), result.keys, result.poses[result.keys]


def part(name: str, log: Log, reference: Floats, count: int) -> World:
    """A map of the first ``count`` scans; ``reference`` (S, 3) of all scans is laid over it."""
    known, keys, path = whole(_cut(log, count))
    shift = laid(reference[keys], path)
    every = key_scans(log, 0.5, 0.25)
    first = int(np.searchsorted(every, count))
    return World(name, log, every, known, compose(shift, reference[every]), first)


def laid(poses: Floats, over: Floats) -> Floats:
    """(3,) the frame of ``poses`` (K, 3) seen in that of ``over`` (K, 3), by least squares."""
    a, b = poses[:, :2] - poses[:, :2].mean(axis=0), over[:, :2] - over[:, :2].mean(axis=0)
    turn = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    c, s = np.cos(turn), np.sin(turn)
    x, y = over[:, :2].mean(axis=0) - np.array([[c, -s], [s, c]]) @ poses[:, :2].mean(axis=0)
    return np.array([x, y, turn])


def _cut(log: Log, count: int) -> Log:
    lights = None if log.intensities is None else log.intensities[:count]
    return replace(
        log,
        t=log.t[:count],
        odometry=log.odometry[:count],
        driven=log.driven[:count],
        ranges=log.ranges[:count],
        intensities=lights,
    )


def _public(file: str, *, halved: bool) -> Callable[[str], World | None]:
    def make(name: str) -> World | None:
        path = DATA / "slam" / f"{file}.log.gz"
        if not path.exists():
            return None
        log = read_log(path)
        known, keys, path_of_keys = whole(log)
        if not halved:
            return World(name, log, keys, known, path_of_keys)
        reference = np.zeros((len(log), 3))
        reference[keys] = path_of_keys
        return part(name, log, reference, int(keys[len(keys) // 2]))

    return make


def _building(plan: str, seed: int, share: float) -> Callable[[str], World | None]:
    def make(name: str) -> World | None:
        driven = drive(plan, Drive(seed=seed))
        log = parse_carmen(carmen(driven))
        return part(name, log, driven.truth, int(share * len(log)))

    return make


def _recording(file: str) -> Callable[[str], World | None]:
    """A map of the first pass; the robot is put into what follows, where things have moved."""

    def make(name: str) -> World | None:
        folder = DATA / "robot" / file
        if not folder.exists():
            return None
        log = read_log(folder / "stream.jsonl.gz")
        truth = np.array(json.loads((folder / "truth.json").read_text())["trajectory"])
        headings = np.unwrap(truth[:, 3])
        columns = [np.interp(log.t, truth[:, 0], column) for column in (truth[:, 1], truth[:, 2], headings)]
        return part(name, log, np.stack(columns, axis=-1), int(np.argmax(np.diff(log.t) > 600.0)) + 1)

    return make


#: Name -> what makes it; None without the data.
WORLDS: dict[str, Callable[[str], World | None]] = {
    "intel": _public("intel", halved=False),
    "fr079": _public("fr079-signfix", halved=False),
    "csail": _public("mit-csail", halved=False),
    "intel-part": _public("intel", halved=True),
    "fr079-part": _public("fr079-signfix", halved=True),
    "csail-part": _public("mit-csail", halved=True),
    **{f"block-{seed}": _building("block", seed, 0.55) for seed in (0, 1, 11, 12)},
    **{f"ring-{seed}": _building("ring", seed, 0.52) for seed in (0, 11)},
    **{f"spine-{seed}": _building("spine", seed, 0.6) for seed in (0, 11)},
    **{f"campus-{seed}": _building("campus", seed, 0.6) for seed in (0, 11)},
    "short10": _recording("slamsd/short10_s1"),
    "clutter": _recording("slamsd/clutter_s1"),
    "room8x8": _recording("slamsd/room8x8_s1"),
}

if __name__ == "__main__":
    main()
