"""Smart cabinet: position against its theoretical limit, events against the laboratory's algorithm, time it takes.

    python benchmarks/cabinet.py                 everything (some minutes on two cores), picture to docs/
    python benchmarks/cabinet.py --quick         everything with fewer things, one minute, no picture
    python benchmarks/cabinet.py --only events   or position, or speed
    python benchmarks/cabinet.py --look cabinet --seed 3 --changes 200     one world: every miss and false alarm

Simulated boards (`tms_agents.simulation.board`) with known truth, each asked as the contestant's program asks it.
An event is found when it was told before the next thing happened, of the right stay, and within 5 cm and thrice what
one second of samples must leave unknown.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from cabinet_contestants import Contestant, Laboratory, Ours
from cabinet_position import WEIGHTS_G, Precision, draw, played, precision
from cabinet_scores import KINDS, Referee, Scores, percentiles
from cabinet_worlds import SCENES, UNSEEN

CONTESTANTS: dict[str, type[Contestant]] = {
    "ours": Ours,
    "laboratory": Laboratory,
}
PICTURE = Path(__file__).resolve().parent.parent / "docs" / "cabinet_position.png"
DEV_SEEDS, UNSEEN_SEEDS, RAMPS_SEEDS = range(5), range(1000, 1005), range(2000, 2005)


@dataclass(frozen=True, slots=True)
class Job:
    scene: str
    contestant: str
    seed: int
    changes: int


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a minute instead of many")
    parser.add_argument("--only", choices=("position", "events", "speed"))
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--look", metavar="SCENE", help="one world, with every error")
    parser.add_argument("--contestant", choices=tuple(CONTESTANTS), default="ours", help="with --look")
    parser.add_argument("--seed", type=int, default=0, help="with --look")
    parser.add_argument("--changes", type=int, default=200, help="with --look")
    args = parser.parse_args(arguments)
    if args.look:
        if args.look not in SCENES | UNSEEN:
            parser.error(f"no scene {args.look!r}; there are {', '.join(SCENES | UNSEEN)}")
        return look(Job(args.look, args.contestant, args.seed, args.changes))
    with ProcessPoolExecutor(args.jobs) as pool:
        if args.only in (None, "position"):
            position(pool, 25 if args.quick else 150, None if args.quick else PICTURE)
        if args.only in (None, "events"):
            events(pool, 60 if args.quick else 1000)
        if args.only in (None, "speed"):
            speed(3000 if args.quick else 30_000)


# position


def position(pool: ProcessPoolExecutor, trials: int, picture: Path | None) -> None:
    """Things of one weight each at random places on an otherwise empty board."""
    jobs = [(name, weight, trials) for weight in WEIGHTS_G for name in CONTESTANTS]
    done = dict(zip([(w, n) for n, w, _ in jobs], pool.map(_precision, jobs), strict=True))
    print(f"Position of one thing on the laboratory's board, root mean square distance in mm, {trials} each\n")
    print(
        "| g | limit | limit, tilt unknown | ours | ratios | seconds | in 95 % ellipse "
        "| told again, seconds | its limit | ours then | ratio | laboratory | found |\n|" + "---|" * 13
    )
    for weight in WEIGHTS_G:
        a, b = done[weight, "ours"], done[weight, "laboratory"]
        print(
            f"| {weight} | {1e3 * a.limit_m:.2f} | {1e3 * a.tilted_m:.2f} | {1e3 * a.rmse_m:.2f} "
            f"| {a.rmse_m / a.limit_m:.2f}, {a.rmse_m / a.tilted_m:.2f} | {a.delay_s:.2f} | {100 * a.covered:.0f} % "
            f"| {a.late_s:.1f} | {1e3 * a.late_limit_m:.2f} | {1e3 * a.late_rmse_m:.2f} "
            f"| {a.late_rmse_m / a.late_limit_m:.2f} "
            f"| {1e3 * b.rmse_m:.1f} | {100 * a.found:.0f} % / {100 * b.found:.0f} % |",
            flush=True,
        )
    print()
    if picture:
        draw({weight: (done[weight, "ours"], done[weight, "laboratory"]) for weight in WEIGHTS_G}, picture)


def _precision(job: tuple[str, int, int]) -> Precision:
    name, weight, trials = job
    return precision(CONTESTANTS[name], weight, trials)


# events


def events(pool: ProcessPoolExecutor, changes: int) -> None:
    """All scenes, five seeds each; ramps also with seeds that were not looked at."""
    rows = {scene: (scene, DEV_SEEDS) for scene in SCENES}
    rows |= {f"{scene}, unseen seeds": (scene, RAMPS_SEEDS) for scene in SCENES if scene.startswith("ramps")}
    rows |= {scene: (scene, UNSEEN_SEEDS) for scene in UNSEEN}
    jobs = [
        Job(scene, name, seed, changes if scene.startswith(("cabinet", "ramps")) else max(changes // 5, 40))
        for scene, seeds in rows.values()
        for seed in seeds
        for name in CONTESTANTS
    ]
    scores = dict(zip(jobs, pool.map(judged, jobs), strict=True))
    print("Events, mean and standard deviation over five seeds\n")
    print(
        "| scene | changes | by | precision | recall | single: precision, recall | two at once: precision, recall "
        "| in place | named | phantoms |\n|---|---|---|---|---|---|---|---|---|---|"
    )
    for title, (scene, seeds) in rows.items():
        for name in CONTESTANTS:
            these = [job for job in jobs if (job.scene, job.contestant) == (scene, name) and job.seed in seeds]
            mine = [scores[job] for job in these]
            count = sum(job.changes for job in these)
            print(
                f"| {title} | {count} | {name} | {_spread([s.precision() for s in mine])} "
                f"| {_spread([s.recall() for s in mine])} "
                f"| {_spread([s.precision(None, 'single') for s in mine])}, "
                f"{_spread([s.recall(None, 'single') for s in mine])} "
                f"| {_spread([s.precision(None, 'pair') for s in mine])}, "
                f"{_spread([s.recall(None, 'pair') for s in mine])} "
                f"| {_spread([s.placed / max(s.things, 1) for s in mine])} "
                f"| {_spread([s.named / max(s.tagged, 1) for s in mine])} "
                f"| {_spread([s.phantoms / max(s.things, 1) for s in mine])} |",
                flush=True,
            )
    for title, scenes in (("known", ["cabinet"]), ("unseen", list(UNSEEN))):
        for name in CONTESTANTS:
            total = Scores()
            for job, score in scores.items():
                if job.scene in scenes and job.contestant == name:
                    total.add(score)
            print(f"\n{name}, {title} worlds ({', '.join(scenes)})\n")
            detail(total)


def detail(scores: Scores) -> None:
    """One contestant by kind of event."""
    print("| event | precision | recall | false alone: rest, lean | seconds from stable: p50, p95, max |")
    print("|---|---|---|---|---|")
    for kind in KINDS:
        p50, p95, most = percentiles(scores.latency_s[kind])
        idle = (scores.false["rest", kind], scores.false["lean", kind])
        print(
            f"| {kind} | {scores.precision(kind):.3f} | {scores.recall(kind):.3f} | {idle[0]}, {idle[1]} "
            f"| {p50:.2f}, {p95:.2f}, {most:.2f} |"
        )
    print(
        f"\nOf the found: {scores.unpinned} as one load over several stays, {scores.reentered} moves as out and in; "
        f"of the missed: {scores.untagged} untagged."
    )


def judged(job: Job) -> Scores:
    """Play one world to one contestant."""
    kind = CONTESTANTS[job.contestant]
    world, household, known = (SCENES | UNSEEN)[job.scene].open(job.seed, even=kind.even)
    contestant = kind(world, known)
    referee = Referee(world, contestant)
    for episode in household.live(job.changes):
        referee.judge(episode, list(played(world, contestant, episode.recording)))
    return referee.scores


def look(job: Job) -> None:
    scores = judged(job)
    print("\n".join(scores.examples), "\n")
    detail(scores)
    for situation in ("single", "pair"):
        precision, recall = scores.precision(None, situation), scores.recall(None, situation)
        print(f"{situation}: precision {precision:.3f}, recall {recall:.3f}")
    print(
        f"of {scores.things} things at rest {scores.placed} in place, of {scores.tagged} tagged ones {scores.named} "
        f"named, {scores.phantoms} phantoms"
    )


def _spread(values: list[float]) -> str:
    values = [value for value in values if value == value]
    if not values:
        return "-"
    return f"{statistics.mean(values):.3f} ± {statistics.stdev(values) if len(values) > 1 else 0:.3f}"


# speed


def speed(samples: int) -> None:
    """CPU time of a contestant for a board of four cells at 50 Hz that is in use."""
    print("\n| by | µs per sample | % of one core at 50 Hz |\n|---|---|---|")
    for name, kind in CONTESTANTS.items():
        world, household, known = SCENES["cabinet"].open(0, even=kind.even)
        cabinet = kind(world, known)
        spent, seen = 0.0, 0
        for episode in household.live(10**6):
            began = time.process_time()
            for _ in played(world, cabinet, episode.recording):
                pass
            spent += time.process_time() - began
            seen += len(episode.recording.t)
            if seen >= samples:
                break
        print(f"| {name} | {1e6 * spent / seen:.1f} | {100 * 50 * spent / seen:.3f} |", flush=True)


if __name__ == "__main__":
    np.seterr(all="raise", under="ignore")
    main()
