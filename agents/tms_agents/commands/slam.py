"""``tms slam``: a map and a trajectory from a recorded drive, and how two of them agree."""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np

from tms_agents.commands.slam_compare import compare
from tms_agents.commands.slam_semidynamic import add_arguments
from tms_agents.slam.export import write_map, write_trajectory
from tms_agents.slam.logs import Log, LogError, parse_laser, read_log
from tms_agents.slam.mapping import Progress, Result, build_map
from tms_agents.slam.settings import Settings
from tms_client.cli import ArgumentParser, CommandError

DEFAULTS = Settings()


def main(argv: Sequence[str]) -> int:
    parser = ArgumentParser(prog="tms slam", description="Laser mapping: build a map from a log, compare results.")
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="COMMAND")
    run = kinds.add_parser("run", help="trajectory and map of a recorded drive")
    run.add_argument("log", type=Path, metavar="LOG", help="CARMEN .log or .clf, recording .jsonl; each may be .gz")
    run.add_argument("--out", type=Path, required=True, metavar="DIR")
    run.add_argument("--models", type=Path, metavar="MODELS.json", help="laser pose (default: models.json beside LOG)")
    run.add_argument("--particles", type=int, default=DEFAULTS.particles, metavar="N")
    run.add_argument("--resolution", type=float, default=DEFAULTS.resolution, metavar="M", help="of the map, m")
    run.add_argument("--seed", type=int, default=DEFAULTS.seed, metavar="S")
    run.add_argument("--threads", type=int, default=0, metavar="N", help="default: all cores; results are the same")
    run.set_defaults(work=_run)
    add_arguments(kinds.add_parser("semidynamic", help="also doors and furniture, whose tags were read"))
    other = kinds.add_parser("compare", help="two results, or one with known relations")
    other.add_argument("a", type=Path, metavar="A", help="DIR of tms slam run, or a trajectory")
    other.add_argument("b", type=Path, metavar="B", help="the same, or relations (.relations, may be .gz)")
    other.add_argument("--odom", type=Path, metavar="FILE", help="t x y theta: reaches moments between poses")
    other.add_argument("--png", type=Path, metavar="FILE", help="both paths in one picture (default: A's folder)")
    other.add_argument("--seed", type=int, default=0, help="as all commands have it; nothing here is random")
    other.set_defaults(work=compare)
    arguments = parser.parse_args(argv)
    done: int = arguments.work(arguments)
    return done


def _run(arguments: argparse.Namespace) -> int:
    if not 1 <= arguments.particles <= 10_000:
        raise CommandError("--particles: from 1 to 10000")
    if not 0.01 <= arguments.resolution <= 0.5:
        raise CommandError("--resolution: from 0.01 to 0.5 m")
    if arguments.seed < 0:
        raise CommandError("--seed: not negative")
    cores = numba.get_num_threads()
    if not 0 <= arguments.threads <= cores:
        raise CommandError(f"--threads: from 1 to {cores}")
    log = _log(arguments)
    try:
        arguments.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(f"{arguments.out}: {error.strerror or error}") from error
    numba.set_num_threads(arguments.threads or cores)
    settings = Settings(particles=arguments.particles, resolution=arguments.resolution, seed=arguments.seed)
    began = time.perf_counter()
    result = build_map(log, settings, _bar())
    seconds = time.perf_counter() - began
    if sys.stderr.isatty():
        sys.stderr.write("\n")
    write_trajectory(arguments.out / "trajectory.txt", log.t, result.poses)
    write_map(arguments.out, result.grid, result.poses[result.keys])
    stats = _stats(log, settings, result, seconds)
    (arguments.out / "stats.json").write_text(json.dumps(stats, indent=2) + "\n")
    if arguments.log.name.removesuffix(".gz").endswith(".jsonl"):
        _write_result(arguments.out, log, result)
    sys.stdout.write(
        f"{stats['scans']} scans, {stats['processed']} processed in {seconds:.1f} s "
        f"({stats['real_time_factor']:.0f} x real time), {stats['loops']} revisits -> {arguments.out}\n"
    )
    return 0


def _log(arguments: argparse.Namespace) -> Log:
    try:
        log = read_log(arguments.log)
        if arguments.models is not None:
            log = replace(log, laser=parse_laser(arguments.models.read_text()))
    except OSError as error:
        raise CommandError(f"{error.filename or arguments.log}: {error.strerror or error}") from error
    except LogError as error:
        raise CommandError(f"{arguments.log}: {error}") from error
    if log.bad_lines:
        sys.stderr.write(f"{arguments.log}: {log.bad_lines} lines could not be read and were left out\n")
    return log


def _stats(log: Log, settings: Settings, result: Result, seconds: float) -> dict[str, float]:
    span = float(log.t[-1] - log.t[0])
    return {
        "scans": len(log),
        "processed": len(result.keys),
        "bad_lines": log.bad_lines,
        "particles": settings.particles,
        "seed": settings.seed,
        "resolution": settings.resolution,
        "log_seconds": span,
        "seconds": seconds,
        "real_time_factor": span / max(1e-9, seconds),
        "cpu_ms_per_scan": 1000 * result.filter_seconds / len(result.keys),
        "cpu_seconds_loop_closing": result.backend_seconds,
        "resamplings": result.resamplings,
        "loops": result.closed.believed,
        "loops_rejected": result.closed.rejected,
        "moved_by_loops_m": result.closed.moved,
        "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def _write_result(folder: Path, log: Log, result: Result) -> None:
    """For recordings with a known truth: trajectory and map in one JSON file."""
    document = {
        "trajectory": np.column_stack([log.t, result.poses]).tolist(),
        "map": {"file": "map.npy", "resolution": result.grid.resolution, "origin": list(result.grid.origin)},
    }
    (folder / "result.json").write_text(json.dumps(document))


def _bar() -> Callable[[Progress], None]:
    """Progress on a terminal, ten times a second; none elsewhere."""
    if not sys.stderr.isatty():
        return lambda progress: None
    last = [0.0]

    def show(progress: Progress) -> None:
        now = time.monotonic()
        if now - last[0] < 0.1 and progress.done < progress.of:
            return
        last[0] = now
        filled = 30 * progress.done // progress.of
        sys.stderr.write(
            f"\r[{'#' * filled}{'.' * (30 - filled)}] {progress.done}/{progress.of} scans, "
            f"{progress.particles} particles, N_eff {progress.effective:.1f}, {progress.real_time:.0f}x real \x1b[K"
        )
        sys.stderr.flush()

    return show
