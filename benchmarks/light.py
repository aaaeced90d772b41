"""Received light in laser mapping: methods x simulated places x seeds, and pictures of the maps.

    python benchmarks/light.py                                       all (an hour on one core)
    python benchmarks/light.py --seeds 100:103 --methods geometry,light --places corridor,eight
    python benchmarks/light.py --pictures docs/light                 maps of seed 0
    python benchmarks/light.py --samples                             recordings of the shared data folder

Seeds 0 to 2 were looked at while the method was made, those from 100 on were not. Times are CPU time of one core.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numba
import numpy as np
from light_scores import Errors, errors
from PIL import Image

from tms_agents.simulation.coloured import PLACES
from tms_agents.simulation.coloured_drive import record
from tms_agents.slam import Log, Settings, build_map, read_log
from tms_agents.slam.export import light_picture
from tms_agents.slam.geometry import Floats
from tms_agents.slam.light.compared import build_compared
from tms_agents.slam.logs import odometry_at
from tms_agents.slam.logs_recording import parse_recording
from tms_agents.slam.mapping import Result

SHARED = Path(os.environ.get("TMS_SHARED_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
METHODS: dict[str, Callable[[Log, int], Result] | None] = {
    "odometry": None,
    "geometry": lambda log, seed: build_map(log, Settings(seed=seed)),
    "icp": lambda log, seed: build_compared(log, Settings(seed=seed), method="icp", light=False),
    "intensity-icp": lambda log, seed: build_compared(log, Settings(seed=seed), method="icp", light=True),
    "paper": lambda log, seed: build_compared(log, Settings(particles=512, seed=seed), method="paper", light=True),
    "light": lambda log, seed: build_map(log, Settings(seed=seed), light=True),
    "light-512": lambda log, seed: build_map(log, Settings(particles=512, seed=seed), light=True),
}


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="0:2,100:103", help="first:last and single ones, comma separated")
    parser.add_argument("--methods", default=",".join(name for name in METHODS if name != "light-512"))
    parser.add_argument("--places", default=",".join(PLACES))
    parser.add_argument("--samples", action="store_true")
    parser.add_argument("--pictures", type=Path, metavar="DIR")
    args = parser.parse_args(arguments)
    methods, places = args.methods.split(","), args.places.split(",")
    if unknown := (set(methods) - set(METHODS)) | (set(places) - set(PLACES)):
        parser.error(f"unknown: {', '.join(sorted(unknown))}")
    numba.set_num_threads(1)
    if args.pictures:
        pictures(args.pictures, places)
        return
    print("| place | seeds | method | longitudinal m, mean (worst) | best fit | revisit | s CPU per s driven |")
    print("|---|---|---|---|---|---|---|")
    if args.samples:
        for folder in sorted((SHARED / "robot" / "intensity").iterdir()):
            log = read_log(folder / "stream.jsonl.gz")
            rows(folder.name, "0:2", methods, {0: _sampled(folder, log)}, [0, 1, 2])
        return
    for place in places:
        for group in args.seeds.split(","):
            seeds = _seeds(group)
            rows(place, group, methods, {seed: _simulated(place, seed) for seed in seeds}, seeds)


def rows(place: str, group: str, methods: list[str], drives: dict[int, tuple[Log, Floats]], seeds: list[int]) -> None:
    """A line per method over all ``seeds``; a single drive is used for all of them."""
    for method in methods:
        found, spent = [], []
        for seed in seeds:
            log, truth = drives.get(seed, drives[min(drives)])
            error, seconds = one(method, log, truth, seed)
            found.append(error)
            spent.append(seconds / float(log.t[-1] - log.t[0]))
        columns = [
            f"{np.mean(values):.3f} ({np.max(values):.3f})"
            for values in ([e.longitudinal for e in found], [e.best for e in found], [e.revisit for e in found])
        ]
        print(f"| {place} | {group} | {method} | {' | '.join(columns)} | {np.mean(spent):.3f} |", flush=True)


def one(method: str, log: Log, truth: Floats, seed: int) -> tuple[Errors, float]:
    """(errors, CPU seconds)."""
    build = METHODS[method]
    began = time.process_time()
    path = log.odometry if build is None else build(log, seed).poses
    return errors(log.t, truth, path), time.process_time() - began


def pictures(folder: Path, places: Sequence[str]) -> None:
    """The light of the map of each place, three pixels a cell at most 1200 wide."""
    folder.mkdir(parents=True, exist_ok=True)
    for place in places:
        log, _ = _simulated(place, 0)
        result = build_map(log, Settings(), light=True)
        assert result.light is not None
        image = Image.fromarray(light_picture(result.grid, result.light)[::-1])
        times = max(1, min(3, 1200 // image.width))
        image.resize((times * image.width, times * image.height), Image.Resampling.NEAREST).save(
            folder / f"{place.replace(' ', '_')}.png", optimize=True
        )


def _seeds(group: str) -> list[int]:
    first, _, last = group.partition(":")
    return list(range(int(first), int(last or first) + 1))


def _simulated(place: str, seed: int) -> tuple[Log, Floats]:
    made = record(place, seed)
    return parse_recording(made.lines, made.models), made.truth


def _sampled(folder: Path, log: Log) -> tuple[Log, Floats]:
    rows = np.array(json.loads((folder / "truth.json").read_text())["trajectory"], dtype=np.float64)
    return log, odometry_at(rows[:, 0], rows[:, 1:], log.t)


if __name__ == "__main__":
    main()
