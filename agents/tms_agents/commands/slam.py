"""``tms slam``: a map and a trajectory from a recorded drive, and how two of them agree."""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from tms_agents.commands import slam_localise, slam_semidynamic, slam_upload
from tms_agents.commands.slam_compare import compare
from tms_agents.commands.slam_log import add_log_options, make_folder, read, set_threads
from tms_agents.slam.export import write_map, write_trajectory
from tms_agents.slam.light.compared import build_compared
from tms_agents.slam.light.paper import PaperSettings
from tms_agents.slam.light.scans import LightError
from tms_agents.slam.logs import Log
from tms_agents.slam.mapping import Progress, Result, build_map
from tms_agents.slam.settings import Settings
from tms_client.cli import ArgumentParser, CommandError

DEFAULTS, PAPER = Settings(), PaperSettings()


def main(argv: Sequence[str]) -> int:
    parser = ArgumentParser(prog="tms slam", description="Laser mapping: build a map from a log, compare results.")
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="COMMAND")
    run = kinds.add_parser("run", help="trajectory and map of a recorded drive")
    add_log_options(run)
    run.add_argument("--out", type=Path, required=True, metavar="DIR")
    run.add_argument(
        "--particles", type=int, metavar="N", help=f"default: {DEFAULTS.particles} (paper: {PAPER.particles})"
    )
    run.add_argument(
        "--least-particles", type=int, default=0, metavar="N", help="adapt their number, from N on (default: fixed)"
    )
    run.add_argument("--resolution", type=float, default=DEFAULTS.resolution, metavar="M", help="of the map, m")
    run.add_argument("--seed", type=int, default=DEFAULTS.seed, metavar="S")
    run.add_argument("--intensity", action="store_true", help="use received light; writes imap.npy and imap.png, too")
    run.add_argument(
        "--method",
        choices=("filter", "paper", "icp"),
        default="filter",
        help="paper (always with light) and icp (with --intensity: Intensity-ICP) are there to compare with",
    )
    run.add_argument("--keep-people", action="store_true", help="map people who walk by as everything else")
    slam_upload.add_options(run)
    run.set_defaults(work=_run)
    place = kinds.add_parser("localise", help="where a robot is in a map that is known, from anywhere")
    slam_localise.add_options(place)
    slam_semidynamic.add_options(kinds.add_parser("semidynamic", help="also doors and furniture, whose tags were read"))
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
    if arguments.particles is None:
        arguments.particles = PAPER.particles if arguments.method == "paper" else DEFAULTS.particles
    if not 1 <= arguments.particles <= 10_000:
        raise CommandError("--particles: from 1 to 10000")
    if not 0 <= arguments.least_particles <= arguments.particles:
        raise CommandError("--least-particles: from 1 to --particles, or 0")
    if not 0.01 <= arguments.resolution <= 0.5:
        raise CommandError("--resolution: from 0.01 to 0.5 m")
    if arguments.seed < 0:
        raise CommandError("--seed: not negative")
    set_threads(arguments.threads)
    log = read(arguments)
    make_folder(arguments.out)
    settings = Settings(
        particles=arguments.particles,
        least_particles=arguments.least_particles,
        resolution=arguments.resolution,
        seed=arguments.seed,
        people=not arguments.keep_people,
    )
    began = time.perf_counter()
    with slam_upload.uploading(arguments) as upload:
        result = _mapped(arguments, log, settings, upload)
        seconds = time.perf_counter() - began
        if sys.stderr.isatty():
            sys.stderr.write("\n")
        stats = _write(arguments, log, settings, result, seconds)
        uploaded = upload.finish(result.grid, result.light)
    sys.stdout.write(
        f"{stats['scans']} scans, {stats['processed']} processed in {seconds:.1f} s "
        f"({stats['real_time_factor']:.0f} x real time), {stats['loops']} revisits -> {arguments.out}{uploaded}\n"
    )
    return 0


def _mapped(arguments: argparse.Namespace, log: Log, settings: Settings, upload: slam_upload.Upload) -> Result:
    try:
        if arguments.method == "filter":
            return build_map(log, settings, _bar(), upload.watch, light=arguments.intensity)
        return build_compared(log, settings, _bar(), method=arguments.method, light=arguments.intensity)
    except LightError as error:
        option = "--method paper" if arguments.method == "paper" else "--intensity"
        raise CommandError(f"{arguments.log}: {error}; {option} needs it") from error


def _write(
    arguments: argparse.Namespace, log: Log, settings: Settings, result: Result, seconds: float
) -> dict[str, float]:
    """All files; what is in the statistics."""
    write_trajectory(arguments.out / "trajectory.txt", log.t, result.poses)
    write_map(arguments.out, result.grid, result.poses[result.keys], result.light)
    stats = _stats(log, settings, result, seconds)
    (arguments.out / "stats.json").write_text(json.dumps(stats, indent=2) + "\n")
    if arguments.log.name.removesuffix(".gz").endswith(".jsonl"):
        _write_result(arguments.out, log, result)
    return stats


def _stats(log: Log, settings: Settings, result: Result, seconds: float) -> dict[str, float]:
    span = float(log.t[-1] - log.t[0])
    stats = {
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
    return stats if result.contrast is None else {**stats, "light_contrast": result.contrast}


def _write_result(folder: Path, log: Log, result: Result) -> None:
    """For recordings with a known truth: trajectory and map in one JSON file."""
    document: dict[str, object] = {
        "trajectory": np.column_stack([log.t, result.poses]).tolist(),
        "map": {"file": "map.npy", "resolution": result.grid.resolution, "origin": list(result.grid.origin)},
    }
    if result.light is not None:
        document["intensity_map"] = {"file": "imap.npy"}
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
