"""Floor sensing on simulated rooms: who walks, what lies there, what is hidden; ours beside the laboratory's algorithm.

    python benchmarks/floor.py                     all tables (half an hour on one core)
    python benchmarks/floor.py --quick             the same with two seeds of each kind and a short hour
    python benchmarks/floor.py --only movers       or objects, plain, faint, static, samples, speed, memory
    python benchmarks/floor.py --seeds unseen      or tuning; both by default
    python benchmarks/floor.py --first 1070        other unseen seeds: five from there on, or --count of them
    python benchmarks/floor.py --untold            nothing of the room is told: neither doors, seats nor sizes of robots
    python benchmarks/floor.py --look "three" --seed 3 --feet prints     one world in numbers

Worlds of `tms_agents.simulation.floor_world`, raw scans of 1081 beams at 10 Hz; `plain`: of 683 beams that reach 5.6 m
and do not tell how brightly they echo; `faint`: the same where echoes fade from 3 m on, as they do in the shared
samples. Seeds below 1000 were there to tune on, those from 1000 on were not. Stone Soup, which is compared for speed,
is no dependency: `pip install stonesoup`.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from floor_contestants import CONTESTANTS, Contestant
from floor_memory import memory
from floor_scores import Scores, score
from floor_speed import speed
from floor_tables import movers_table, objects_table, requirements_table, static_table

from tms_agents.devices.scans import Sweep
from tms_agents.simulation.floor_world import LASERS, UNSEEN, FloorWorld

Feet = Literal["legs", "prints"]

TUNING_SEEDS = range(1, 6)
MOVER_SCENES = (
    *("one", "three", "three close", "eight", "start", "bed", "standing"),
    *("robots", "two lasers", "mirror", "misplaced"),
)
OBJECT_SCENES = (
    *("things", "near wall", "glossy", "hidden", "standing", "furniture"),
    *("robots", "two lasers", "mirror", "misplaced"),
)
PLAIN_SCENES = ("one", "three", "three close", "visits", "bed", "robots", "things", "furniture")
SCENES = tuple(dict.fromkeys(MOVER_SCENES + OBJECT_SCENES))
FEET: tuple[Feet, ...] = ("legs", "prints")
SAMPLES = Path(os.environ.get("TMS_SHARED_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))


@dataclass(frozen=True, slots=True)
class Job:
    scene: str
    feet: Feet
    seed: int
    contestant: str
    duration: float | None = None
    laser: str = "fine"
    told: bool = True


@dataclass(frozen=True, slots=True)
class Outcome:
    """``late_events`` and ``late_labels`` were told after half a minute."""

    scores: Scores
    late_events: int
    late_labels: int


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer seeds")
    parser.add_argument(
        "--only", choices=("movers", "objects", "plain", "faint", "static", "samples", "speed", "memory")
    )
    parser.add_argument("--seeds", choices=("tuning", "unseen", "both"), default="both")
    parser.add_argument("--first", type=int, default=UNSEEN, help="first of the unseen seeds")
    parser.add_argument("--count", type=int, default=5, help="how many unseen seeds")
    parser.add_argument("--contestants", default="ours,laboratory", help="comma separated")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--hours", type=float, help="simulated hours of --only memory and static, 24 and 1 by default")
    parser.add_argument("--untold", action="store_true", help="nothing of the room is told")
    parser.add_argument("--look", metavar="SCENE", help="one world")
    parser.add_argument("--feet", choices=FEET, default="prints", help="with --look")
    parser.add_argument("--seed", type=int, default=1, help="with --look")
    args = parser.parse_args(arguments)
    if args.count < 1:
        parser.error(f"at least one seed must be played, not {args.count}")
    names = args.contestants.split(",")
    if unknown := set(names) - set(CONTESTANTS):
        parser.error(f"no contestant {', '.join(unknown)}; there are {', '.join(CONTESTANTS)}")
    if args.look:
        try:
            for name in names:
                look(Job(args.look, args.feet, args.seed, name, told=not args.untold))
            return
        except ValueError as error:
            parser.error(str(error))
    seeds = {"tuning": TUNING_SEEDS, "unseen": range(args.first, args.first + args.count)}
    seeds = {name: found[:2] if args.quick else found for name, found in seeds.items() if args.seeds in (name, "both")}
    with ProcessPoolExecutor(args.jobs) as pool:
        if args.only in (None, "movers", "objects"):
            scenes = {"movers": MOVER_SCENES, "objects": OBJECT_SCENES}.get(args.only or "", SCENES)
            worlds(pool, scenes, seeds, names, told=not args.untold)
        if args.only in (None, "plain"):
            print("# A coarse laser without brightness\n")
            worlds(pool, PLAIN_SCENES, seeds, names, laser="coarse", told=not args.untold)
        if args.only in (None, "faint"):
            print("# The same, but its echoes fade\n")
            worlds(pool, PLAIN_SCENES, seeds, names, laser="faint", told=not args.untold)
        if args.only in (None, "static"):
            hours = args.hours or (0.2 if args.quick else 1.0)
            static(pool, seeds, names, 3600 * hours, told=not args.untold)
    if args.only in (None, "samples"):
        samples(names)
    if args.only in (None, "speed"):
        speed()
    if args.only in (None, "memory"):
        memory(args.hours or (0.5 if args.quick else 24.0))


# worlds


def worlds(
    pool: ProcessPoolExecutor,
    scenes: Sequence[str],
    seeds: dict[str, range],
    names: Sequence[str],
    *,
    laser: str = "fine",
    told: bool = True,
) -> None:
    """Every scene with every kind of feet, seen by one of `LASERS`: the coarse ones tell no brightness.

    ``told``: the contestants know the plan of the room.
    """
    jobs = [
        Job(scene, feet, seed, name, laser=laser, told=told)
        for scene in scenes
        for feet in FEET
        for kind in seeds.values()
        for seed in kind
        for name in names
    ]
    done = dict(zip(jobs, pool.map(judged, jobs), strict=True))

    def of(scene: str, feet: str, kind: str, name: str) -> list[Scores]:
        return [done[Job(scene, _feet(feet), seed, name, laser=laser, told=told)].scores for seed in seeds[kind]]

    for kind, numbers in seeds.items():
        print(f"## Seeds {numbers[0]} to {numbers[-1]} ({kind}); mean and standard deviation over the seeds\n")
        if moving := [scene for scene in scenes if laser != "fine" or scene in MOVER_SCENES]:
            print(movers_table({(s, f, n): of(s, f, kind, n) for s in moving for f in FEET for n in names}), end="\n\n")
        if lying := [scene for scene in scenes if laser != "fine" or scene in OBJECT_SCENES]:
            print(objects_table({(s, f, n): of(s, f, kind, n) for s in lying for f in FEET for n in names}), end="\n\n")
    if "ours" in names:
        ours: dict[tuple[str, str, str], list[Scores]] = {
            (kind, scene, feet): of(scene, feet, kind, "ours") for kind in seeds for scene in scenes for feet in FEET
        }
        print(requirements_table(ours), end="\n\n", flush=True)


def judged(job: Job) -> Outcome:
    """Play one world to one contestant."""
    world = FloorWorld(job.scene, job.seed, feet=job.feet, laser=LASERS[job.laser], duration=job.duration)
    sensors = {name: (mount.laser.sweep(), mount.reported) for name, mount in world.sensors.items()}
    contestant = CONTESTANTS[job.contestant](sensors, world.known() if job.told else None)
    scans = ((f.sensor, f.t, f.ranges, f.intensities if job.laser == "fine" else None) for f in world.scans())
    prediction, late_events = told(contestant, scans)
    late = {one["id"] for frame in prediction if frame["t"] > 30 for one in frame["labels"]}
    return Outcome(score(world.truth(), prediction), late_events, len(late))


def told(contestant: Contestant, scans: Iterable[tuple[str, float, Any, Any]]) -> tuple[list[dict[str, Any]], int]:
    """(prediction, events after 30 s)."""
    prediction, late = [], 0
    for sensor, t, ranges, intensities in scans:
        events = contestant.scan(sensor, t, ranges, intensities)
        late += events if t > 30 else 0
        prediction.append({"t": t, "labels": contestant.labels()})
    return prediction, late


def look(job: Job) -> None:
    """One world: all scores, every thing that was missed, every object that was none."""
    outcome = judged(job)
    print(f"{job}\n{outcome.scores.movers}\n{outcome.scores.objects.summary()}")
    for span in outcome.scores.objects.spans:
        print(span)
    for false in outcome.scores.objects.false:
        print(false)


# nothing happens


def static(
    pool: ProcessPoolExecutor, seeds: dict[str, range], names: Sequence[str], seconds: float, *, told: bool
) -> None:
    """Nobody is there: how many events and labels after the first half minute?"""
    numbers = [seed for kind in seeds.values() for seed in kind]
    jobs = [Job("static", "prints", seed, name, seconds, told=told) for seed in numbers for name in names]
    done = dict(zip(jobs, pool.map(judged, jobs), strict=True))
    rows = {(job.contestant, job.seed): (one.late_events, one.late_labels) for job, one in done.items()}
    print(static_table(rows, seconds), end="\n\n", flush=True)


# the shared recordings


def samples(names: Sequence[str]) -> None:
    """The simulated samples of the shared data folder, where it is."""
    folder = SAMPLES / "floor" / "sim"
    truths = sorted(folder.glob("*.json"))
    if not truths:
        print(f"No shared samples at {folder} (TMS_SHARED_DATA)\n")
        return
    scores: dict[tuple[str, str, str], list[Scores]] = {}
    for path in truths:
        truth = json.loads(path.read_text())
        scene, _, feet = path.stem.partition("_")
        for name in names:
            scores[scene, feet, name] = [score(truth, _sample(folder, truth, name))]
    print("## Shared samples\n")
    print(movers_table(scores), end="\n\n")
    print(objects_table(scores), end="\n\n", flush=True)


def _sample(folder: Path, truth: dict[str, Any], name: str) -> list[dict[str, Any]]:
    sensors, scans = {}, []
    for one in truth["sensors"]:
        with np.load(folder / one["file"]) as data:
            sweep = Sweep(
                data["angles"].astype(float),
                float(data["time_increment"]),
                1 / float(data["scan_rate"]),
                float(data["range_min"]),
                float(data["range_max"]),
                str(data["model"]),
            )
            sensors[one["name"]] = (sweep, tuple(data["sensor_pose"]))
            ranges = data["ranges"].astype(float)
            scans += [(one["name"], float(t), row, None) for t, row in zip(data["t"], ranges, strict=True)]
    contestant = CONTESTANTS[name](sensors)
    return told(contestant, sorted(scans, key=lambda scan: scan[1]))[0]


def _feet(name: str) -> Feet:
    return "legs" if name == "legs" else "prints"


if __name__ == "__main__":
    main()
