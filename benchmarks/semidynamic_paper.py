"""Things that are moved now and then: our method beside the paper's filter, given the same path of the robot.

    python benchmarks/semidynamic_paper.py                                    some minutes on one core
    python benchmarks/semidynamic_paper.py --worlds short --drives 30:31 --seeds 1
    python benchmarks/semidynamic_paper.py --worlds short --picture docs/semidynamic_paper.png

Times are CPU time of one core: of the paper's filter per update (one detection of one tag, the rewriting of the grid
included), of our method for all objects and the map. The paths, the same for all, are not in them.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import numba
import numpy as np
from semidynamic_cuts import first_pass
from semidynamic_pictures import panels
from semidynamic_scores import Scores, best_fit, scores
from semidynamic_views import MapScores, map_scores, view_of

from tms_agents.simulation.semidynamic_drive import record
from tms_agents.simulation.semidynamic_plans import PLANS
from tms_agents.slam import Log, Settings, read_log
from tms_agents.slam.geometry import Floats
from tms_agents.slam.logs import lines_of_file, odometry_at
from tms_agents.slam.semidynamic import (
    Models,
    PaperSettings,
    PoseOf,
    Rounds,
    Semidynamic,
    parse_models,
    parse_rounds,
    robot_path,
)
from tms_agents.slam.semidynamic.drawing import draw
from tms_agents.slam.semidynamic.paper import follow
from tms_agents.slam.semidynamic.pipeline import RESOLUTION_M
from tms_agents.slam.semidynamic.solving import solve

#: Of objects and map.
Told = tuple[Scores, MapScores]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", default="short,clutter,room")
    parser.add_argument("--drives", default="30:30", metavar="FIRST:LAST", help="seeds of the worlds")
    parser.add_argument("--seeds", type=int, default=3, metavar="N", help="of the paper's filter, each")
    parser.add_argument("--picture", type=Path, metavar="PNG", help="of the first world and seed, no table")
    args = parser.parse_args(arguments)
    worlds = args.worlds.split(",")
    if unknown := set(worlds) - set(PLANS):
        parser.error(f"unknown: {', '.join(sorted(unknown))}")
    first, _, last = args.drives.partition(":")
    numba.set_num_threads(1)
    if args.picture:
        with tempfile.TemporaryDirectory() as folder:
            record(worlds[0], int(first), Path(folder))
            picture(Path(folder), args.picture)
        return
    print("| world, seed | method | right | found | doors wrong | ghosts | ms per update, median (worst) | s in all |")
    print("|---|---|---|---|---|---|---|---|")
    warm = True
    for world in worlds:
        for seed in range(int(first), int(last or first) + 1):
            with tempfile.TemporaryDirectory() as folder:
                record(world, seed, Path(folder))
                rows(f"{world}, {seed}", Path(folder), args.seeds, warm)
            warm = False


def rows(name: str, folder: Path, seeds: int, warm: bool) -> None:
    log, rounds, models = _read(folder)
    truth = json.loads((folder / "truth.json").read_text())
    poses = robot_path(log, Settings())
    view = view_of(truth, models, float(log.t[-1]))

    def scored(result: Semidynamic) -> Told:
        return scores(log, truth, result), map_scores(result.grid, best_fit(log, truth, poses), view)

    if warm:  # what is compiled at its first use is not measured
        _paper(log, poses, rounds, models, "mean", 0)
        _default(log, poses, rounds, models)
    began = time.process_time()
    ours = _default(log, poses, rounds, models)
    spent = time.process_time() - began
    _row(name, "default", [scored(ours)], "-", spent)
    for pose_of in get_args(PoseOf):
        found, updates, began = [], [], time.process_time()
        for seed in range(seeds):
            result, seconds = _paper(log, poses, rounds, models, pose_of, seed)
            found.append(result)
            updates.append(seconds)
        spent = (time.process_time() - began) / seeds
        ms = 1000 * np.concatenate(updates)
        told = [scored(result) for result in found]
        _row(name, f"paper, {pose_of}", told, f"{np.median(ms):.1f} ({ms.max():.1f})", spent)


def picture(folder: Path, path: Path) -> None:
    log, rounds, models = _read(folder)
    poses = robot_path(log, Settings())
    before, _ = _paper(*first_pass(log, poses, rounds), models, "mean", 0)
    after, _ = _paper(log, poses, rounds, models, "mean", 0)
    ours = _default(log, poses, rounds, models)
    panels(path, models, [("paper, first pass", before), ("paper, last pass", after), ("default, last pass", ours)])


def _read(folder: Path) -> tuple[Log, Rounds, Models]:
    log = read_log(folder / "stream.jsonl.gz")
    rounds, _ = parse_rounds(lines_of_file(folder / "stream.jsonl.gz"))
    return log, rounds, parse_models((folder / "models.json").read_text())


def _default(log: Log, poses: Floats, rounds: Rounds, models: Models) -> Semidynamic:
    stays = solve(log, poses, rounds, odometry_at(log.t, poses, rounds.t), models, 0)
    return Semidynamic(poses, stays, draw(log, poses, stays, models, RESOLUTION_M))


def _paper(
    log: Log, poses: Floats, rounds: Rounds, models: Models, pose_of: PoseOf, seed: int
) -> tuple[Semidynamic, Floats]:
    found = follow(log, poses, rounds, models, PaperSettings(pose_of=pose_of), seed, RESOLUTION_M)
    return Semidynamic(poses, found.stays, found.grid), found.seconds


def _row(name: str, method: str, told: Sequence[Told], updates: str, seconds: float) -> None:
    def total(field: str) -> Any:
        return sum(getattr(one, field) for one, _ in told)

    expected = total("expected")
    print(
        f"| {name} | {method} | {total('right')} of {expected} | {total('found')} | {total('doors_wrong')} | "
        f"{sum(one.ghosts for _, one in told) / len(told):.2f} | {updates} | {seconds:.1f} |",
        flush=True,
    )


if __name__ == "__main__":
    main()
