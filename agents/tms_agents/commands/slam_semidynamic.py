"""``tms slam semidynamic``: path, map and objects that are moved now and then, from a recording with tag reads."""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from pathlib import Path

import numpy as np

from tms_agents.commands.slam_log import make_folder
from tms_agents.slam.export import write_map, write_trajectory
from tms_agents.slam.log_files import read_log
from tms_agents.slam.logs import Log, LogError, lines_of_file
from tms_agents.slam.semidynamic import (
    Models,
    PaperSettings,
    Rounds,
    Semidynamic,
    map_with_objects,
    parse_models,
    parse_rounds,
)
from tms_agents.slam.settings import Settings
from tms_client.cli import CommandError


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("log", type=Path, metavar="RECORDING", help="recording .jsonl, may be .gz")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--models", type=Path, metavar="MODELS.json", help="default: models.json beside RECORDING")
    parser.add_argument("--seed", type=int, default=0, metavar="S")
    parser.add_argument(
        "--method", choices=("default", "paper"), default="default", help="paper: a particle filter per detected tag"
    )
    parser.add_argument(
        "--pose-of",
        choices=("heaviest", "mean"),
        help="with --method paper: the heaviest particle where N_eff was largest, or the mean (default: mean)",
    )
    parser.set_defaults(work=semidynamic)


def semidynamic(arguments: argparse.Namespace) -> int:
    if arguments.seed < 0:
        raise CommandError("--seed: not negative")
    if arguments.pose_of and arguments.method != "paper":
        raise CommandError("--pose-of: only with --method paper")
    log, rounds, models = _read(arguments)
    make_folder(arguments.out)
    began = time.perf_counter()
    paper = PaperSettings(pose_of=arguments.pose_of or "mean") if arguments.method == "paper" else None
    result = map_with_objects(log, rounds, models, Settings(seed=arguments.seed), paper=paper)
    seconds = time.perf_counter() - began
    write_trajectory(arguments.out / "trajectory.txt", log.t, result.poses)
    write_map(arguments.out, result.grid, result.poses)
    (arguments.out / "result.json").write_text(json.dumps(_result(log, result)))
    driven = float(np.diff(log.t)[np.diff(log.t) < 600].sum())
    stats = {
        "scans": len(log),
        "rounds": len(rounds.t),
        "objects": len(result.stays),
        "visits": sum(map(len, result.stays.values())),
        "seconds": seconds,
        "real_time_factor": driven / max(seconds, 1e-9),
        "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    (arguments.out / "stats.json").write_text(json.dumps(stats, indent=2) + "\n")
    for tag, stays in result.stays.items():
        x, y, theta = stays[-1].pose
        sys.stdout.write(
            f"{tag} {models.objects[tag].kind}: x {x:.2f} m, y {y:.2f} m, {np.degrees(theta):.0f} deg, "
            f"{len(stays)} visits\n"
        )
    sys.stdout.write(f"{stats['scans']} scans in {seconds:.1f} s -> {arguments.out}\n")
    return 0


def _read(arguments: argparse.Namespace) -> tuple[Log, Rounds, Models]:
    if not arguments.log.name.removesuffix(".gz").endswith(".jsonl"):
        raise CommandError(f"{arguments.log}: tag reads are in recordings only (.jsonl or .jsonl.gz)")
    models_file = arguments.models or arguments.log.with_name("models.json")
    try:
        models = parse_models(models_file.read_text())
        log = read_log(arguments.log)
        rounds, bad = parse_rounds(lines_of_file(arguments.log))
    except OSError as error:
        raise CommandError(f"{error.filename or arguments.log}: {error.strerror or error}") from error
    except (LogError, UnicodeDecodeError) as error:
        raise CommandError(f"{arguments.log}: {error}") from error
    unknown = sorted(set(rounds.antenna.tolist()) - set(models.antennas))
    if unknown:
        raise CommandError(f"{models_file}: no antenna {', '.join(map(str, unknown))}")
    if bad + log.bad_lines:
        sys.stderr.write(f"{arguments.log}: {bad + log.bad_lines} lines could not be read and were left out\n")
    return log, rounds, models


def _result(log: Log, result: Semidynamic) -> dict[str, object]:
    """As the scorer of robot recordings reads it."""
    return {
        "trajectory": np.column_stack([log.t, result.poses]).tolist(),
        "objects": {
            tag: dict(zip(("x", "y", "theta"), stays[-1].pose.tolist(), strict=True))
            for tag, stays in result.stays.items()
        },
        "objects_history": {
            tag: [[float(log.t[stay.visit.scans[0]]), *stay.pose.tolist()] for stay in stays]
            for tag, stays in result.stays.items()
        },
        "map": {"file": "map.npy", "resolution": result.grid.resolution, "origin": list(result.grid.origin)},
    }
