"""Things that are moved now and then: path, objects and map of simulated worlds, and a clamped grid beside ours.

    python benchmarks/semidynamic.py                                    a quarter of an hour on one core
    python benchmarks/semidynamic.py --worlds long,loop --drives 50:52

Ghosts are shares of the surfaces of things as they were met before these were moved: of all, and of those that no beam
went through since, at the end; and of all half-way through the last pass, with all that was known by then, beside a
grid of clamped log-odds of the same beams at the same poses. CPU time is of one thread, loading of compiled code
included (at the first time ever also compiling it); memory is the largest of the process.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np
from semidynamic_cuts import until
from semidynamic_scores import Scores, best_fit, scores
from semidynamic_views import MapScores, map_scores, view_of

from tms_agents.simulation.semidynamic_drive import record
from tms_agents.simulation.semidynamic_plans import PLANS
from tms_agents.slam import Log, Settings, read_log
from tms_agents.slam.geometry import Floats
from tms_agents.slam.gridmap import GridMap, grid_map, render
from tms_agents.slam.keyframes import key_scans
from tms_agents.slam.logs import lines_of_file, odometry_at
from tms_agents.slam.semidynamic import Models, Rounds, map_with_objects, parse_models, parse_rounds
from tms_agents.slam.semidynamic.drawing import draw
from tms_agents.slam.semidynamic.pipeline import RESOLUTION_M
from tms_agents.slam.semidynamic.solving import solve

#: Scans of the clamped grid: one every so much (m, rad).
_STEP_M, _STEP_RAD, _REACH_M = 0.1, 0.1, 0.2


@dataclass(frozen=True, slots=True)
class Row:
    """Of one drive: at the end, half-way through its last pass ours and the clamped grid, and what it cost."""

    scores: Scores
    map: MapScores
    halfway: MapScores
    clamped: MapScores
    driven_s: float
    cpu_s: float
    megabytes: float


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", default="short,room,clutter,shifted,long,loop", help=f"of {', '.join(PLANS)}")
    parser.add_argument("--drives", default="50:50", metavar="FIRST:LAST", help="seeds of the worlds")
    args = parser.parse_args(arguments)
    worlds = args.worlds.split(",")
    if unknown := set(worlds) - set(PLANS):
        parser.error(f"unknown: {', '.join(sorted(unknown))}")
    first, _, last = args.drives.partition(":")
    print(
        "| world, seed | path, m | objects right | doors wrong | F at 5 cm | ghosts, all / never looked at again "
        "| half-way: ours / clamped grid | CPU s (times real time) | MB |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for world in worlds:
        for seed in range(int(first), int(last or first) + 1):
            print(_line(f"{world}, {seed}", _in_own_process(world, seed)), flush=True)


def _in_own_process(world: str, seed: int) -> Row:
    """So that its memory is its own."""
    with tempfile.TemporaryDirectory() as folder:
        record(world, seed, Path(folder))
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
            return process.submit(row, Path(folder)).result()


def row(folder: Path) -> Row:
    numba.set_num_threads(1)
    log = read_log(folder / "stream.jsonl.gz")
    rounds, _ = parse_rounds(lines_of_file(folder / "stream.jsonl.gz"))
    models = parse_models((folder / "models.json").read_text())
    truth = json.loads((folder / "truth.json").read_text())
    began = time.process_time()
    result = map_with_objects(log, rounds, models, Settings())
    spent = time.process_time() - began
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    end, middle = float(log.t[-1]), _halfway(truth)
    to_world = best_fit(log, truth, result.poses)
    before, earlier, by_then = until(log, result.poses, rounds, middle)
    halfway = view_of(truth, models, middle)
    return Row(
        scores(log, truth, result),
        map_scores(result.grid, to_world, view_of(truth, models, end)),
        map_scores(_ours(before, earlier, by_then, models), to_world, halfway),
        map_scores(_clamped(before, earlier), to_world, halfway),
        sum(b - a for a, b in truth["passes"]),
        spent,
        megabytes,
    )


def _halfway(truth: dict[str, list[list[float]]]) -> float:
    """Through the last pass, or the last of two rounds without a stop."""
    begin, end = truth["passes"][-1]
    return (begin + end) / 2 if len(truth["passes"]) > 1 else begin + 0.75 * (end - begin)


def _ours(log: Log, poses: Floats, rounds: Rounds, models: Models) -> GridMap:
    stays = solve(log, poses, rounds, odometry_at(log.t, poses, rounds.t), models, 0)
    return draw(log, poses, stays, models, RESOLUTION_M)


def _clamped(log: Log, poses: Floats) -> GridMap:
    """Log-odds of all beams between -2 and 3.5: what was there is worn away where beams go through."""
    scans = key_scans(log, _STEP_M, _STEP_RAD)
    return grid_map(render(poses[scans], [log.points(int(n)) for n in scans], log.laser[:2], RESOLUTION_M, _REACH_M), 0)


def _line(name: str, one: Row) -> str:
    told = one.scores
    return (
        f"| {name} | {told.path_m:.3f} | {told.right} of {told.expected} | {told.doors_wrong} of {told.doors} "
        f"| {one.map.f:.3f} | {one.map.ghosts:.2f} / {_share(one.map.ghosts_unseen)} "
        f"| {one.halfway.ghosts:.2f} / {one.clamped.ghosts:.2f} "
        f"| {one.cpu_s:.0f} ({one.driven_s / one.cpu_s:.0f}) | {one.megabytes:.0f} |"
    )


def _share(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.2f}"


if __name__ == "__main__":
    main()
