"""``tms floor replay``: recordings in, labels after every scan out."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace as changed
from typing import Any

from pydantic import ValidationError

from tms_agents.commands.floor_files import require_place, result, warn, write_file
from tms_agents.config import faults_of, read_config
from tms_agents.floor.calibration.poses import calibrated
from tms_agents.floor.config import FloorConfig
from tms_agents.floor.recordings.formats import read_scans
from tms_agents.floor.recordings.recorded import Recorded, mounted, within
from tms_agents.floor.recordings.replay import Replay, Tracks
from tms_agents.floor.settings import Pose
from tms_agents.floor.watch.picture import tracks_png
from tms_agents.floor.watch.watching import config_of, play
from tms_client.cli import CommandError


def replay(arguments: argparse.Namespace) -> int:
    require_place(arguments.out)
    require_place(arguments.png, ".png")
    config, recordings = recordings_of(arguments)
    tracks = Tracks()
    try:
        run = Replay(recordings, config.settings(), config.room_scene())
        with result(arguments.out) as file:
            file.write(b"[")
            for n, frame in enumerate(run.frames(_progress(run.scans))):
                file.write((", " * bool(n) + json.dumps(frame, allow_nan=False)).encode())
                if arguments.png is not None:
                    tracks.add(frame)
            file.write(b"]\n")
    except ValueError as error:
        raise CommandError(f"{', '.join(map(str, arguments.scans))}: {error}") from error
    if arguments.png is not None:
        write_file(arguments.png, tracks_png(_walls(recordings, config), tracks.all()))
    return 0


def recordings_of(arguments: argparse.Namespace) -> tuple[FloorConfig, list[Recorded]]:
    """Recordings, each with a name of its own and the pose that is given for it, and how to look at them.

    Raises:
        CommandError: a file, the configuration or a pose cannot be used.
    """
    like: FloorConfig | None = None
    poses: dict[str, Pose] = {}
    if arguments.config is not None:
        like, poses = calibrated(read_config(arguments.config, FloorConfig), arguments.config)
    lasers = {} if like is None else {one.name: one for one in like.lasers}
    recordings: list[Recorded] = []
    for one in [one for path in arguments.scans for one in read_scans(path, warn)]:
        name, count = one.name, 2
        while name in [other.name for other in recordings]:
            name, count = f"{one.name} {count}", count + 1
        pose, laser = poses.get(one.name, one.pose), lasers.get(one.name)
        if laser is not None:
            one = within(mounted(one, upside_down=laser.upside_down), laser.range_max_m)
            one = changed(one, range_scale=laser.range_scale)
        recordings.append(changed(one, name=name, pose=pose))
    if arguments.pose:
        given = [_pose(text) for text in arguments.pose]
        if len(given) != len(recordings):
            names = ", ".join(one.name for one in recordings)
            raise CommandError(f"--pose is given {len(given)} times, there are {len(recordings)} sensors: {names}")
        recordings = [changed(one, pose=pose) for one, pose in zip(recordings, given, strict=True)]
    try:
        return config_of(recordings, like), recordings
    except ValidationError as error:
        raise CommandError(f"{', '.join(map(str, arguments.scans))}: {faults_of(error)}") from error


def _pose(text: str) -> Pose:
    try:
        x, y, theta = map(float, text.split(","))
        if not all(map(math.isfinite, (x, y, theta))):
            raise ValueError
    except ValueError:
        raise CommandError(f"--pose {text!r}: it is x,y,theta (metres, radians)") from None
    return (x, y, theta)


def _walls(recordings: Sequence[Recorded], config: FloorConfig) -> dict[str, Any]:
    """The view at the end of recordings."""
    view: dict[str, Any] = {}
    for _, shown in play(recordings, config, every_s=1.0):
        view = shown
    return view


def _progress(total: int) -> Callable[[int], None]:
    if not sys.stderr.isatty():
        return lambda done: None

    def show(done: int) -> None:
        if done % 50 == 0 or done == total:
            sys.stderr.write(f"\r{done}/{total} scans" + ("\n" if done == total else ""))

    return show
