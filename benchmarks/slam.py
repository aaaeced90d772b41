"""Laser mapping on public logs and on simulated buildings with long loops: accuracy over seeds, CPU time, memory.

    python benchmarks/slam.py                          all tables (an hour on one core)
    python benchmarks/slam.py --only logs --seeds 3    logs, particles, buildings, drawn, people or threads
    python benchmarks/slam.py --only logs --logs intel

The public logs are read from the shared data folder (`TMS_SHARED_DATA`); docs/slam.md says where they come from. Every
run is a process of its own with one thread: CPU time is that of one core, memory is the peak above what a process needs
that has imported everything and loaded what was compiled before.
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import multiprocessing
import os
import resource
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numba
import numpy as np
from scipy.ndimage import distance_transform_edt

from tms_agents.simulation.building import PLANS, Drive, Driven, carmen, drive
from tms_agents.simulation.tours import drawn_plan
from tms_agents.slam import Log, Result, Settings, build_map, read_log
from tms_agents.slam.filter import ParticleFilter
from tms_agents.slam.geometry import Floats, between, transform
from tms_agents.slam.keyframes import key_scans, poses_of_all
from tms_agents.slam.logs_carmen import parse_carmen
from tms_agents.slam.metric import agreement_with, read_relations
from tms_agents.slam.witnesses import people_by_path

DATA = Path(os.environ.get("TMS_SHARED_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")) / "slam"
#: Name of the log -> its relations, and what they are.
LOGS = {
    "intel": ("intel.relations.gz", "truth"),
    "fr079-signfix": ("fr079.logtime.relations.gz", "truth"),
    "mit-csail": ("mit-csail.pseudo.relations.gz", "published run"),
}
PARTICLES = (1, 10, 30, 50, 100, 512)
#: Odometry as good as that of the MIT Killian Court log, and much worse.
WHEELS = {"good": Drive(turn_per_m=0.01, pull_per_m=0.0003), "poor": Drive()}

BUILDINGS = tuple(f"{plan} {wheels}" for plan in PLANS for wheels in WHEELS)
#: Plans and ways that are drawn by the seed (2 km), and what differs from a usual drive (see `Drive`).
DRAWN = (
    "drawn good",
    "drawn poor",
    "drawn poor irregular=0 rooms=0",
    "drawn poor range_max=8",
    "drawn poor beams=90 noise_m=0.03 lost=0.1",
    "drawn poor turn_per_m=0.04 way_per_m=0.08",
    "drawn poor width=5 range_max=12",
    "drawn poor people=1",
)


@dataclass(frozen=True, slots=True)
class Job:
    """``world`` is a log, or "plan wheels key=value ...", the last of which change a `Drive`. ``twice``: the second run
    in the process counts, to which all compiled kernels are in memory."""

    world: str
    seed: int
    particles: int = 30
    threads: int = 1
    twice: bool = False


@dataclass(frozen=True, slots=True)
class Outcome:
    """Errors (m, degrees) of the filter alone and after loop closing; times per processed scan (ms), memory (MB)."""

    job: Job
    scans: int
    filtered: float
    closed: float
    rotation: float
    worst: float
    filter_ms: float
    all_ms: float
    wall_s: float
    span_s: float
    above_mb: float
    #: A digest of the path.
    bits: str


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=("logs", "particles", "buildings", "drawn", "people", "threads"))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--logs", default=",".join(LOGS), help="comma separated")
    parser.add_argument("--buildings", default=",".join(BUILDINGS), help='"plan wheels", comma separated')
    parser.add_argument("--jobs", type=int, default=1, help="processes side by side")
    args = parser.parse_args(arguments)
    seeds = range(args.first, args.first + args.seeds)
    if unknown := set(args.logs.split(",")) - set(LOGS):
        parser.error(f"no log {', '.join(unknown)}; there are {', '.join(LOGS)}")
    here = [name for name in args.logs.split(",") if (DATA / f"{name}.log.gz").exists()]
    if not here:
        print(f"No shared logs at {DATA} (TMS_SHARED_DATA)\n")
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(args.jobs, mp_context=spawn, max_tasks_per_child=1) as pool:
        pool.submit(run, Job("block good", 0)).result()  # compiles what is not compiled yet
        if args.only in (None, "logs"):
            over_seeds(pool, here, seeds)
        if args.only in (None, "particles") and "intel" in here:
            print("## Particles (Intel, seed 0)\n\n" + HEADER)
            for outcome in pool.map(run, [Job("intel", 0, particles) for particles in PARTICLES]):
                print(_row(f"intel, {outcome.job.particles}", [outcome]), flush=True)
            print()
        if args.only in (None, "threads") and "intel" in here:
            with_threads(pool)
        if args.only in (None, "buildings"):
            over_seeds(pool, args.buildings.split(","), seeds)
        if args.only in (None, "drawn"):
            over_seeds(pool, DRAWN, seeds)
        if args.only in (None, "people"):
            with_people(pool, seeds)


HEADER = (
    "| log | error m, mean (worst seed) | filter alone | rotation deg | largest error m | scans | filter ms/scan "
    "| all ms/scan | x real time by CPU | MB above imports |\n|---|---|---|---|---|---|---|---|---|---|"
)


def over_seeds(pool: ProcessPoolExecutor, worlds: Iterable[str], seeds: range) -> None:
    """A line per world."""
    print(f"## 30 particles, {len(seeds)} seeds\n\n{HEADER}")
    for world in worlds:
        print(_row(world, list(pool.map(run, [Job(world, seed) for seed in seeds]))), flush=True)
    print()


def _row(name: str, found: list[Outcome]) -> str:
    closed, filtered = np.array([o.closed for o in found]), np.array([o.filtered for o in found])
    return (
        f"| {name} | {closed.mean():.4f} ({closed.max():.4f}) | {filtered.mean():.4f} ({filtered.max():.4f}) "
        f"| {np.mean([o.rotation for o in found]):.2f} | {max(o.worst for o in found):.2f} | {found[0].scans} "
        f"| {np.mean([o.filter_ms for o in found]):.1f} | {np.mean([o.all_ms for o in found]):.1f} "
        f"| {np.mean([1000 * o.span_s / (o.all_ms * o.scans) for o in found]):.0f} "
        f"| {max(o.above_mb for o in found):.0f} |"
    )


def with_threads(pool: ProcessPoolExecutor) -> None:
    """Wall time of one and of two threads in turns, the best of three each, compiled kernels in memory: for a computer
    with nothing else to do."""
    print("## Threads (Intel, 30 particles)\n")
    print("| threads | wall s, best of 3 | CPU ms per scan | same bits |\n|---|---|---|---|")
    jobs = [Job("intel", 0, threads=threads, twice=True) for threads in (1, 2)]
    found = [[pool.submit(run, job).result() for job in jobs] for _ in range(3)]
    for runs in zip(*found, strict=True):
        best, bits = min(runs, key=lambda o: o.wall_s), {o.bits for o in runs} == {found[0][0].bits}
        print(f"| {best.job.threads} | {best.wall_s:.2f} | {best.all_ms:.1f} | {'yes' if bits else 'NO'} |")
    one, two = (min(o.wall_s for o in runs) for runs in zip(*found, strict=True))
    print(f"\nTwo threads are {one / two:.2f} times as fast as one.\n", flush=True)


#: Building, people per 10 m of way, legs or bodies.
CROWDS = (("block", 2.0, True), ("block", 2.0, False), ("block", 5.0, False), ("ring", 3.0, False))


def with_people(pool: ProcessPoolExecutor, seeds: range) -> None:
    """A line per building and crowd: people kept out or not."""
    print(f"## People in the way, seeds {seeds.start} to {seeds.stop - 1}\n")
    print(
        "| building, people | beams on people | found | wall beams dropped | error m (worst) | people kept m (worst) "
        "| cells of people left | people kept |\n|---|---|---|---|---|---|---|---|"
    )
    for crowd in CROWDS:
        rows = np.array(list(pool.map(run_crowd, [(*crowd, seed) for seed in seeds])))
        beams, recall, wrong, error, kept, cells, before = rows.T
        print(
            f"| {crowd[0]}, {crowd[1]:g} {'legs' if crowd[2] else 'bodies'} per 10 m | {beams.mean():.1%} "
            f"| {recall.mean():.1%} | {wrong.mean():.3%} | {error.mean():.3f} ({error.max():.3f}) "
            f"| {kept.mean():.3f} ({kept.max():.3f}) | {cells.mean():.0f} | {before.mean():.0f} |",
            flush=True,
        )
    print()


def run_crowd(world: tuple[str, float, bool, int]) -> tuple[float, ...]:
    """(share of beams on people, share of those found, share of others dropped, error m with people left out and with
    people kept, occupied cells where people were met and no wall is near, with people left out and kept)."""
    plan, people, legs, seed = world
    numba.set_num_threads(1)
    driven = drive(plan, Drive(seed=seed, step_m=0.5, step_rad=0.3, people=people, legs=legs))
    log, relations = parse_carmen(carmen(driven)), _relations(driven.t, driven.truth)
    errors, cells = [], []
    for keep in (False, True):
        result = build_map(log, Settings(seed=seed, people=not keep))
        errors.append(agreement_with(relations, np.column_stack([log.t, result.poses])).translation)
        cells.append(_cells_of_people(driven, log, result))
        if not keep:
            scans = [log.points(int(n)) for n in result.keys]
            found = np.concatenate(people_by_path(log, result.keys, scans, result.filtered))
    truth = np.concatenate([driven.people[n][log.returned(int(n))] for n in result.keys])
    return float(truth.mean()), float(found[truth].mean()), float(found[~truth].mean()), *errors, *cells


def _cells_of_people(driven: Driven, log: Log, result: Result) -> int:
    """Occupied cells in which people were met, and farther than 0.15 m from where a beam ended on a wall."""
    occupied = result.grid.probabilities() > 0.65
    met, walls = np.zeros_like(occupied), np.ones_like(occupied)
    for n in result.keys:
        places = (transform(result.poses[n], log.points(int(n))) - result.grid.origin) / result.grid.resolution
        x, y = np.floor(places).astype(int).T
        inside = (x >= 0) & (y >= 0) & (x < occupied.shape[1]) & (y < occupied.shape[0])
        who = driven.people[n][log.returned(int(n))]
        met[y[inside & who], x[inside & who]] = True
        walls[y[inside & ~who], x[inside & ~who]] = False
    return int(np.count_nonzero(occupied & met & (distance_transform_edt(walls) > 3)))


def run(job: Job) -> Outcome:
    """One run in this process."""
    numba.set_num_threads(min(job.threads, numba.get_num_threads()))
    log, relations, odometry = _world(job.world, job.seed)
    settings = Settings(particles=job.particles, seed=job.seed)
    _warm(log)
    if job.twice:
        build_map(log, settings)
    before = _peak_mb()
    began = time.perf_counter()
    result = build_map(log, settings)
    wall = time.perf_counter() - began
    peak = _peak_mb()
    filtered = poses_of_all(log, result.keys, result.filtered)
    errors = [
        agreement_with(relations, np.column_stack([log.t, poses]), odometry) for poses in (filtered, result.poses)
    ]
    scans = len(result.keys)
    return Outcome(
        job,
        scans,
        errors[0].translation,
        errors[1].translation,
        errors[1].rotation,
        errors[1].translation_worst,
        1000 * result.filter_seconds / scans,
        1000 * (result.filter_seconds + result.backend_seconds) / scans,
        wall,
        float(log.t[-1] - log.t[0]),
        peak - before,
        hashlib.sha256(result.poses.tobytes()).hexdigest(),
    )


def _warm(log: Log) -> None:
    """Loads the compiled kernels: two scans, two particles."""
    particles = ParticleFilter(Settings(particles=2), log.laser)
    for n in key_scans(log, 0.5, 0.25)[:2]:
        particles.process(log.odometry[n], log.driven[n], log.points(int(n)))


def _world(name: str, seed: int) -> tuple[Log, Floats, Floats | None]:
    """(log, relations, odometry of all records)."""
    if name in LOGS:
        with gzip.open(DATA / f"{name}.odom.txt.gz", "rt") as file:
            odometry = np.loadtxt(file, usecols=(0, 1, 2, 3))
        return read_log(DATA / f"{name}.log.gz"), read_relations(DATA / LOGS[name][0]), odometry
    plan, wheels, *parts = name.split()
    kinds = {field.name: field.type for field in fields(Drive)}
    changes = dict(change.split("=") for change in parts)
    numbers: dict[str, Any] = {k: int(v) if kinds[k] == "int" else float(v) for k, v in changes.items()}
    how = replace(WHEELS[wheels], seed=seed, **numbers)
    way = drawn_plan(np.random.default_rng([seed, 77])) if plan == "drawn" else plan
    driven = drive(way, how)
    return parse_carmen(carmen(driven)), _relations(driven.t, driven.truth), None


def _relations(t: Floats, truth: Floats) -> Floats:
    """Between scans that follow each other, and between visits of the same place (within 3 m, 40 scans apart)."""
    first, second = list(range(len(truth) - 1)), list(range(1, len(truth)))
    for n in range(0, len(truth), 2):
        apart = np.hypot(*(truth[:, :2] - truth[n, :2]).T)
        apart[: n + 40] = np.inf
        other = int(np.argmin(apart))
        if apart[other] < 3.0:
            first.append(n)
            second.append(other)
    return np.column_stack([t[first], t[second], between(truth[first], truth[second])])


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
