"""``tms floor calibrate``: scans of the lasers, and the pose that fits them best."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tms_agents.clocks import Clocks
from tms_agents.devices.scans import Array, Scan, Sweep
from tms_agents.devices.transport import DeviceState
from tms_agents.floor.calibration.walkers import Registration, register, walker_tracks
from tms_agents.floor.config import FloorConfig, LaserSection
from tms_agents.floor.lasers import Laser
from tms_agents.floor.recordings.formats import Say, read_scans
from tms_agents.floor.recordings.recorded import Recorded, forward, mounted, thinned, within
from tms_agents.floor.runner import listen
from tms_agents.floor.scan.walls import MATCHED_M, Fit, fit_walls
from tms_agents.floor.settings import FloorSettings, Pose
from tms_client import Town, TownError
from tms_client.cli import CommandError

_MOST_SCANS = 20_000
#: Of a long recording so many scans tell where the walls are as well as all do.
_MOST_STILL = 5000
_WAIT_S, _SHOW_S = 20.0, 0.5
#: More than this is no fit that an installer wants.
_LEAST_MATCHED, _MOST_RMSE_M = 0.3, 0.02
#: A share of beams at a wall that is larger by so much speaks for itself.
_CLEARLY = 0.1
#: By walkers: how well another pose may explain the same, and how unsure the pose may be (m, rad). In simulated rooms
#: right ones had 0.33 and less, 9 cm and less; wrong ones, of 5 to 15 s seen by both, 0.6 and more or 15 cm and more.
_MOST_RIVAL, _UNSURE_M, _UNSURE = 0.6, 0.1, 0.035


async def gather(config: FloorConfig, names: Sequence[str], seconds: float, show: Say) -> list[Recorded]:
    """What these lasers see for so many seconds, from when all of them deliver; ``show`` is told how far it is.

    Raises:
        CommandError: one does not deliver.
    """
    sections = {one.name: one for one in config.lasers if one.name in names}
    clocks = Clocks(time.time, time.monotonic)
    lasers = {name: Laser(section) for name, section in sections.items()}
    found: dict[str, list[tuple[float, Scan]]] = {name: [] for name in sections}

    def take(name: str, scans: Sequence[Scan]) -> None:
        mounted = [lasers[name].mounted(scan) for scan in scans]
        times = lasers[name].times.of(clocks.now(), mounted)
        found[name] = (found[name] + list(zip(times, mounted, strict=True)))[-_MOST_SCANS:]

    def changed(name: str, state: DeviceState) -> None:
        lasers[name].line(state)

    tasks = [asyncio.create_task(listen(one, config.silent_after_s, take, changed)) for one in sections.values()]
    try:
        until = clocks.now() + _WAIT_S
        while not all(found.values()):
            if clocks.now() > until:
                name = next(name for name, scans in found.items() if not scans)
                state = lasers[name].state
                raise CommandError(f"laser {name} delivers no scans{f': {state.why}' if state else ''}")
            await asyncio.sleep(0.05)
        for scans in found.values():
            scans.clear()
        begun = clocks.now()
        while (left := begun + seconds - clocks.now()) > 0:
            show(f"{seconds - left:.0f} of {seconds:g} s, {sum(map(len, found.values()))} scans")
            await asyncio.sleep(min(left, _SHOW_S))
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    return [_recorded(name, lasers[name].pose, found[name]) for name in names]


def from_files(paths: Sequence[Path], config: FloorConfig, names: Sequence[str], say: Say) -> list[Recorded]:
    """The same out of recordings: by the lasers' names, or in their order where there is a file for each.

    ``say`` is told what of them is left out.

    Raises:
        CommandError: a file cannot be read, or it is not clear which laser made it.
    """
    recordings = [one for path in paths for one in read_scans(path, say)]
    by_name = {one.name: one for one in recordings}
    if set(names) <= set(by_name):
        chosen = [by_name[name] for name in names]
    elif len(recordings) == len(names):
        chosen = recordings
    else:
        raise CommandError(f"the recordings hold {', '.join(sorted(by_name))}, wanted are {', '.join(names)}")
    lasers = {one.name: one for one in config.lasers}
    return [
        replace(_as_configured(one, lasers[name]), name=name, pose=lasers[name].pose.pose)
        for name, one in zip(names, chosen, strict=True)
    ]


def _as_configured(one: Recorded, laser: LaserSection) -> Recorded:
    return within(mounted(one, upside_down=laser.upside_down), laser.range_max_m)


def outline_of(config: FloorConfig, given: str | None) -> list[tuple[float, float]]:
    """The room's outline: as given ("0,0 6,0 6,5 0,5"), the scene's region, or what the server knows.

    Raises:
        CommandError: there is none.
    """
    if given is not None:
        try:
            corners = [tuple(map(float, corner.split(","))) for corner in given.replace(";", " ").split()]
            if len(corners) < 3 or any(len(corner) != 2 or not all(map(math.isfinite, corner)) for corner in corners):
                raise ValueError
        except ValueError:
            raise CommandError(f"--outline {given!r}: corners like '0,0 6,0 6,5 0,5', metres") from None
        return [(corner[0], corner[1]) for corner in corners]
    if config.scene.region is not None:
        return list(config.scene.region)
    try:
        with Town(config.server.url, config.server.key) as town:
            outline = town.rooms.get(config.room).outline
    except TownError as error:
        raise CommandError(
            f"no outline: give --outline, [scene] region, or a server that knows it ({error})"
        ) from error
    if not outline:
        raise CommandError(f"room {config.room!r} has no outline at the server: give --outline or [scene] region")
    return list(outline)


def static_points(sweep: Sweep, ranges: Array) -> Array:
    """(n, 2) m in the sensor's frame of what stands still in scans (T, B): beams that mostly echo, at their median."""
    found = np.isfinite(ranges)
    steady = found.mean(axis=0) >= 0.5
    if not steady.any():
        return np.empty((0, 2))
    middle = np.nanmedian(np.where(found, ranges, np.nan)[:, steady], axis=0)
    angles = sweep.angles[steady]
    return np.stack([middle * np.cos(angles), middle * np.sin(angles)], axis=1)


def by_walls(recorded: Recorded, outline: Sequence[tuple[float, float]], say: Say, *, force: bool) -> Fit:
    """Raises CommandError where nothing fits well enough, or the laser seems to be mounted the other way up."""
    points = static_points(recorded.sweep, thinned(recorded, _MOST_STILL).ranges)
    try:
        fit = fit_walls(points, outline, recorded.pose)
    except ValueError as error:
        if _mirrored(points, outline, recorded.pose, None):
            raise CommandError(f"laser {recorded.name}: {error}; {_OTHER_WAY_UP}") from error
        raise CommandError(f"laser {recorded.name}: {error}") from error
    _tell(recorded.name, recorded.pose, fit.pose, say)
    near, rmse = MATCHED_M * 1000, fit.rmse_m * 1000
    say(f"  {fit.matched:.0%} of {fit.points} beams end within {near:.0f} mm of a wall, RMSE {rmse:.1f} mm")
    x, y, turn = fit.sd[0] * 1000, fit.sd[1] * 1000, math.degrees(fit.sd[2])
    say(f"  uncertainty: x {x:.1f} mm, y {y:.1f} mm, {turn:.2f} degrees")
    longer, sure = round(100 * (1 / fit.range_scale - 1), 2) + 0.0, 100 * fit.range_scale_sd
    unknown = "" if fit.known_scale is not None else ", which is not sure enough to go by"
    say(f"  it measures {longer:+.2f} % too long (+- {sure:.2f}){unknown}")
    if force:
        return fit
    if _mirrored(points, outline, recorded.pose, fit):
        raise CommandError(f"laser {recorded.name}: {_OTHER_WAY_UP} (--force keeps it)")
    if not _fits_well(fit):
        raise CommandError(
            f"laser {recorded.name}: that is no good fit; is the outline right, and the pose by ruler within "
            "half a metre and 20 degrees? --force keeps it"
        )
    return fit


_OTHER_WAY_UP = (
    "were it mounted the other way up, the walls would fit, nearer to the pose by ruler: is upside_down right?"
)


def _fits_well(fit: Fit) -> bool:
    return fit.matched >= _LEAST_MATCHED and fit.rmse_m <= _MOST_RMSE_M


def _mirrored(points: Array, outline: Sequence[tuple[float, float]], pose: Pose, fit: Fit | None) -> bool:
    """Whether the laser seems to be mounted the other way up: most rooms are not told from their mirror image."""
    try:
        other = fit_walls(points * (1.0, -1.0), outline, pose)
    except ValueError:
        return False
    if not _fits_well(other):
        return False
    if fit is None or other.matched > fit.matched + _CLEARLY:
        return True
    as_well = other.matched > fit.matched - _CLEARLY / 5 and other.rmse_m < fit.rmse_m + 0.001
    return as_well and _off(other.pose, pose) < _off(fit.pose, pose) / 2


def _off(one: Pose, other: Pose) -> float:
    """How far two poses are from each other (m); a degree counts as 2 cm, what rulers and eyes err by is 5 cm."""
    turned = abs(math.atan2(math.sin(one[2] - other[2]), math.cos(one[2] - other[2])))
    return max(0.05, math.dist(one[:2], other[:2]) + 1.15 * turned)


def by_walkers(known: Recorded, recorded: Recorded, settings: FloorSettings, say: Say, *, force: bool) -> Registration:
    """The pose of ``recorded``'s laser from people that ``known`` saw, too. Raises CommandError."""
    there = walker_tracks(known, known.pose, settings)
    here = walker_tracks(recorded, (0.0, 0.0, 0.0), settings)
    say(f"  {known.name} saw {len(there)} tracks, {recorded.name} {len(here)}")
    try:
        found = register(there, here)
    except ValueError as error:
        raise CommandError(f"lasers {known.name} and {recorded.name}: {error}") from error
    _tell(recorded.name, recorded.pose, found.pose, say)
    rmse, offset = found.rmse_m * 1000, found.offset_s
    say(f"  {found.places} places seen by both, RMSE {rmse:.0f} mm, clocks {offset:+.2f} s apart")
    away, turned = found.sd[0] * 1000, math.degrees(found.sd[1])
    say(f"  uncertainty: {away:.0f} mm, {turned:.1f} degrees")
    if found.rmse_m > 0.12:
        wrong = "that is no good fit; have one person walk there"
    elif found.rival > _MOST_RIVAL:
        wrong = "it may as well stand elsewhere; have one person walk there, longer, and not to and fro"
    elif found.sd[0] > _UNSURE_M or found.sd[1] > _UNSURE:
        wrong = "that is not sure enough; have one person walk longer through all that both lasers see"
    else:
        return found
    if not force:
        raise CommandError(f"laser {recorded.name}: {wrong} (--force keeps it)")
    return found


def _tell(name: str, before: Pose, after: Pose, say: Say) -> None:
    say(f"laser {name}: x {after[0]:.3f} m, y {after[1]:.3f} m, theta {after[2]:.4f} rad")
    moved = math.dist(before[:2], after[:2])
    turned = math.degrees(math.atan2(math.sin(after[2] - before[2]), math.cos(after[2] - before[2])))
    say(f"  from the pose in the configuration: {moved * 1000:.0f} mm, {turned:+.2f} degrees")


def _recorded(name: str, pose: Pose, scans: Sequence[tuple[float, Scan]]) -> Recorded:
    if not scans:
        raise CommandError(f"laser {name} stopped delivering scans")
    sweep = scans[-1][1].sweep
    same = [(t, scan) for t, scan in scans if scan.sweep is sweep]
    t, rows = np.array([t for t, _ in same]), [(scan.ranges, scan.intensities) for _, scan in same]
    return forward(Recorded(name, sweep, pose, t, rows, upside_down=None))  # mounted already
