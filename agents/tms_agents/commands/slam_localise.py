"""``tms slam localise``: where a robot drove in a map that is known, or that it cannot be told."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from tms_agents.commands.slam_log import add_log_options, make_folder, pose, read, set_threads
from tms_agents.slam.export import map_picture, write_trajectory
from tms_agents.slam.geometry import Floats
from tms_agents.slam.known import MapError, known_map, read_npz
from tms_agents.slam.localisation import Estimate
from tms_agents.slam.localisation_settings import LocalisationSettings
from tms_agents.slam.localising import Localised, localise
from tms_agents.slam.logs import Log
from tms_client import Town
from tms_client.cli import CommandError
from tms_client.commands.options import add_server_options
from tms_client.errors import TownError
from tms_client.maps.files import read_folder

DEFAULTS = LocalisationSettings()
#: Exit status where the robot is not localised in the end.
NOT_LOCALISED = 1
Grid = tuple[Floats, tuple[float, float], float]


def add_options(parser: argparse.ArgumentParser) -> None:
    add_log_options(parser)
    parser.add_argument(
        "--map", required=True, metavar="MAP", help="folder, map.yaml of map_server, map.npz, or a map of the server"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for trajectory, estimates, stats and picture")
    parser.add_argument("--start", type=pose, metavar="X,Y,THETA", help="where it began, about (default: anywhere)")
    parser.add_argument("--particles", type=int, default=DEFAULTS.particles, metavar="N", help="at most")
    parser.add_argument("--seed", type=int, default=DEFAULTS.seed, metavar="S")
    add_server_options(parser)
    parser.set_defaults(work=run)


def run(arguments: argparse.Namespace) -> int:
    if not 100 <= arguments.particles <= 1_000_000:
        raise CommandError("--particles: from 100 to 1000000")
    if arguments.seed < 0:
        raise CommandError("--seed: not negative")
    set_threads(arguments.threads)
    log = read(arguments)
    grid = _grid(arguments)
    try:
        known = known_map(*grid)
    except MapError as error:
        raise CommandError(f"{arguments.map}: {error}") from error
    if arguments.out is not None:
        make_folder(arguments.out)
    settings = LocalisationSettings(particles=arguments.particles, seed=arguments.seed, start=arguments.start)
    found = localise(log, known, settings, _bar())
    if sys.stderr.isatty():
        sys.stderr.write("\n")
    stats = statistics(log, found, settings)
    if arguments.out is not None:
        _write(arguments.out, log, grid, found, stats)
    sys.stdout.write(_sentence(found, stats) + "\n")
    return 0 if found.estimates[-1].localised else NOT_LOCALISED


def statistics(log: Log, found: Localised, settings: LocalisationSettings) -> dict[str, object]:
    """What ``stats.json`` holds; the moment of convergence is null where there was none."""
    numbers = np.array([one.particles for one in found.estimates])
    believed = np.array([one.localised for one in found.estimates])
    way = log.driven[found.keys] - log.driven[found.keys[0]]
    milliseconds = 1000 * found.seconds
    first = found.first
    return {
        "localised": bool(believed[-1]),
        "scans": len(log),
        "processed": len(found.keys),
        "bad_lines": log.bad_lines,
        "seed": settings.seed,
        "converged_after_scans": None if first is None else first + 1,
        "converged_at": None if first is None else float(log.t[found.keys[first]]),
        "converged_after_m": None if first is None else float(way[first, 0]),
        "share_of_scans_localised": float(believed.mean()),
        "particles": {"first": int(numbers[0]), "median": float(np.median(numbers)), "last": int(numbers[-1])},
        "cpu_ms_per_scan": float(milliseconds.mean()),
        "cpu_ms_per_scan_localised": float(milliseconds[believed].mean()) if believed.any() else None,
        "hypotheses": [
            {
                "weight": one.weight,
                "pose": one.pose.tolist(),
                "spread_m": one.spread_m,
                "spread_rad": one.spread_rad,
                "covariance": one.covariance.tolist(),
            }
            for one in found.estimates[-1].hypotheses
        ],
    }


def _write(folder: Path, log: Log, grid: Grid, found: Localised, stats: dict[str, object]) -> None:
    believed = found.believed
    write_trajectory(folder / "trajectory.txt", log.t[believed], found.poses[believed])
    with (folder / "estimates.txt").open("w", encoding="ascii") as file:
        file.write("# timestamp x y theta localised weight spread_m spread_rad particles\n")
        for n, one in zip(found.keys, found.estimates, strict=True):
            x, y, theta = one.best.pose
            file.write(
                f"{log.t[n]:.6f} {x:.4f} {y:.4f} {theta:.5f} {one.localised:d} {one.best.weight:.4f} "
                f"{one.best.spread_m:.4f} {one.best.spread_rad:.5f} {one.particles}\n"
            )
    (folder / "stats.json").write_text(json.dumps(stats, indent=2) + "\n")
    occupancy, origin, resolution = grid
    path = np.where(believed[found.keys, None], found.poses[found.keys], np.nan)
    Image.fromarray(map_picture(occupancy, origin, resolution, path)).save(folder / "localised.png")


def _sentence(found: Localised, stats: dict[str, object]) -> str:
    last, first = found.estimates[-1], found.first
    processed = f"{stats['processed']} scans processed, {stats['cpu_ms_per_scan']:.1f} ms CPU each"
    x, y, theta = last.best.pose
    where = f"x {x:.2f} m, y {y:.2f} m, {theta:.2f} rad"
    if last.localised:
        return (
            f"localised after {stats['converged_after_m']:.1f} m ({(first or 0) + 1} scans); in the end at {where}, "
            f"+- {last.best.spread_m:.2f} m; {processed}"
        )
    share = f"not in the end ({stats['share_of_scans_localised']:.0%} of the scans)"
    before = "not localised" if first is None else f"localised after {stats['converged_after_m']:.1f} m, {share}"
    return f"{before}; the best guess is {where} ({last.best.weight:.0%}); {processed}"


def _grid(arguments: argparse.Namespace) -> Grid:
    path = Path(arguments.map)
    try:
        if path.is_dir() and (path / "map.npz").exists():
            path = path / "map.npz"
        if path.suffix == ".npz":
            return read_npz(path)
        if path.exists() or path.suffix:
            grid = read_folder(path).grid
            return grid.occupancy.astype(np.float64), grid.origin, grid.resolution
        with Town(arguments.url, arguments.key) as town:
            view = town.map(arguments.map)
            return view.occupancy.astype(np.float64), view.origin, view.resolution
    except OSError as error:
        raise CommandError(f"{path}: {error.strerror or error}") from error
    except MapError as error:
        raise CommandError(f"{path}: {error}") from error
    except TownError as error:
        raise CommandError(str(error)) from error


def _bar() -> Callable[[int, int, Estimate], None]:
    """Progress on a terminal, ten times a second; none elsewhere."""
    if not sys.stderr.isatty():
        return lambda done, of, estimate: None
    last = [0.0]

    def show(done: int, of: int, estimate: Estimate) -> None:
        now = time.monotonic()
        if now - last[0] < 0.1 and done < of:
            return
        last[0] = now
        filled = 30 * done // of
        state = "localised" if estimate.localised else f"{len(estimate.hypotheses)} guesses"
        sys.stderr.write(
            f"\r[{'#' * filled}{'.' * (30 - filled)}] {done}/{of} scans, {estimate.particles} particles, {state} \x1b[K"
        )
        sys.stderr.flush()

    return show
