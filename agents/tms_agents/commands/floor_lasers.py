"""``tms floor calibrate`` and ``tms floor record``: what is done with the lasers of an agent that does not run."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime

from tms_agents.clocks import Clocks
from tms_agents.commands.floor_files import warn
from tms_agents.config import read_config
from tms_agents.devices.scans import Scan
from tms_agents.devices.transport import DeviceState
from tms_agents.floor.calibration.calibrating import by_walkers, by_walls, from_files, gather, outline_of
from tms_agents.floor.calibration.poses import LaserCalibration, read_poses, write_poses
from tms_agents.floor.config import FloorConfig, LaserSection
from tms_agents.floor.lasers import Laser
from tms_agents.floor.recordings.recorded import Recorded
from tms_agents.floor.recordings.recording import ScanWriter
from tms_agents.floor.runner import listen
from tms_agents.live import socket_path, views
from tms_agents.running import until_signalled
from tms_client.cli import CommandError


def calibrate(arguments: argparse.Namespace, clock: Callable[[], float] = time.time) -> int:
    config = read_config(arguments.config, FloorConfig)
    laser = _laser(config, arguments.laser)
    path = config.calibration_path(arguments.config)
    known = read_poses(path)  # before the work, not after it
    if arguments.walkers is not None:
        other = _laser(config, arguments.walkers)
        if other.name == laser.name:
            raise CommandError(f"--walkers {other.name!r}: that is the laser itself")
        there, here = _scans(arguments, config, [other.name, laser.name], 60.0)
        if other.name in known:
            there = replace(there, pose=known[other.name].pose, range_scale=known[other.name].range_scale)
        found = by_walkers(there, here, config.settings(), _say, force=arguments.force)
        pose, rmse, scale = found.pose, found.rmse_m, None
    else:
        outline = outline_of(config, arguments.outline)
        (here,) = _scans(arguments, config, [laser.name], 10.0)
        fit = by_walls(here, outline, _say, force=arguments.force)
        pose, rmse, scale = fit.pose, fit.rmse_m, fit.known_scale
    calibration = LaserCalibration(
        x=round(pose[0], 5),
        y=round(pose[1], 5),
        theta=round(pose[2], 6),
        method="walls" if arguments.walkers is None else "walkers",
        rmse_m=round(rmse, 5),
        range_scale=None if scale is None else round(scale, 5),
        measured_at=datetime.fromtimestamp(clock(), UTC),
    )
    old = write_poses(path, known | {laser.name: calibration})
    _say(f"Written to {path}{f'; the old one is {old.name}' if old else ''}. Restart the agent to use it.")
    return 0


def record(arguments: argparse.Namespace) -> int:
    config = read_config(arguments.config, FloorConfig)
    if arguments.out.suffix != ".scans":
        raise CommandError(f"{arguments.out}: the name of a recording ends in .scans")
    if arguments.seconds is not None and not 0.5 <= arguments.seconds < math.inf:
        raise CommandError("--seconds is 0.5 or more")
    try:
        writer = ScanWriter(arguments.out, config.upside_down)
    except (OSError, ValueError) as error:
        raise CommandError(f"{arguments.out}: {getattr(error, 'strerror', None) or error}") from error
    if words := writer.damage.in_words():
        warn(f"{arguments.out}: {words}")
    try:
        with contextlib.closing(writer), contextlib.suppress(asyncio.CancelledError):
            asyncio.run(until_signalled(_record(config, arguments, writer)))
    except OSError as error:
        kept = f"{writer.kept} scans were kept" if writer.kept else "no scan was kept"
        raise CommandError(f"{arguments.out}: {error.strerror or error}; {kept}") from error
    _say(f"{arguments.out}: {writer.written} scans")
    return 0 if writer.written else 1


async def _record(config: FloorConfig, arguments: argparse.Namespace, writer: ScanWriter) -> None:
    await _require_no_agent(config, "it can record itself ([recording] in its configuration)")
    known = read_poses(config.calibration_path(arguments.config))
    clocks = Clocks(time.time, time.monotonic)
    poses = {name: one.pose for name, one in known.items()}
    lasers = {one.name: Laser(one, poses.get(one.name)) for one in config.lasers}

    def take(name: str, scans: Sequence[Scan]) -> None:
        mounted = [lasers[name].mounted(scan) for scan in scans]
        for t, scan in zip(lasers[name].times.of(clocks.now(), mounted), mounted, strict=True):
            writer.add(name, lasers[name].pose, t, scan)  # evenly, whatever the computer's clock does
        _show(f"{writer.written} scans")

    def changed(name: str, state: DeviceState) -> None:
        _say(f"laser {name}: {state.state}: {state.why}")

    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(arguments.seconds):
            await asyncio.gather(*(listen(one, config.silent_after_s, take, changed) for one in config.lasers))


def _scans(arguments: argparse.Namespace, config: FloorConfig, names: list[str], usual_s: float) -> list[Recorded]:
    if arguments.scans:
        return from_files(arguments.scans, config, names, warn)
    seconds = usual_s if arguments.seconds is None else arguments.seconds
    if not 0.5 <= seconds <= 3600:
        raise CommandError("--seconds is 0.5 to 3600")

    async def look() -> list[Recorded]:
        await _require_no_agent(config, "stop it first")
        _say(f"Looking for {seconds:g} s{'; walk through the whole room' if len(names) > 1 else ''} ...")
        found = await gather(config, names, seconds, _show)
        _show("\n")
        return found

    try:
        return asyncio.run(until_signalled(look()))
    except asyncio.CancelledError:  # by Ctrl-C: nothing was found out, nothing is to be said
        raise KeyboardInterrupt from None


async def _require_no_agent(config: FloorConfig, advice: str) -> None:
    with contextlib.suppress(OSError):
        async with contextlib.aclosing(views(socket_path(config.spool.path))) as shown:
            async for _ in shown:
                raise CommandError(f"agent {config.agent} is running and has the lasers: {advice}")


def _laser(config: FloorConfig, name: str | None) -> LaserSection:
    names = [one.name for one in config.lasers]
    if name is None and len(names) == 1:
        return config.lasers[0]
    if name not in names:
        raise CommandError(f"which laser? one of: {', '.join(names)}")
    return config.lasers[names.index(name)]


def _show(text: str) -> None:
    """How far it is, over what was shown before, where somebody looks."""
    if sys.stderr.isatty():
        sys.stderr.write(text if text == "\n" else f"\r{text} ")
        sys.stderr.flush()


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()
