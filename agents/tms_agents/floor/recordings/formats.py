"""Recorded scans out of files: ours, npz, CSV, ROS bags. All come out alike, whatever stands for "nothing" in them."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

from tms_agents.bags import is_bag
from tms_agents.floor.recordings.formats_csv import read_csv
from tms_agents.floor.recordings.formats_npz import read_npz
from tms_agents.floor.recordings.formats_rosbag import read_rosbag
from tms_agents.floor.recordings.reading import read_recording
from tms_agents.floor.recordings.recorded import Recorded, forward
from tms_agents.floor.recordings.records import Damage
from tms_client.cli import CommandError

Say = Callable[[str], object]
log = logging.getLogger(__name__)


def read_scans(path: Path, say: Say = log.warning) -> list[Recorded]:
    """Everything that a file holds, a recording per sensor; ``say`` is told what of it is left out, a line each.

    Raises:
        CommandError: the file cannot be read, is of no known kind or holds no scan; one line that says why.
    """
    try:
        found = _read(path, say)
    except OSError as error:
        raise CommandError(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise CommandError(f"{path}: {error}") from error
    if not any(map(len, found)):
        raise CommandError(f"{path}: it holds no scan")
    return [_forward(path, one, say) for one in found if len(one)]


def _forward(path: Path, one: Recorded, say: Say) -> Recorded:
    usable = forward(one)
    if left_out := len(one) - len(usable):
        say(f"{path}: {left_out} of {len(one)} scans of {one.name} are left out: they are not later than one before")
    return usable


def _read(path: Path, say: Say) -> list[Recorded]:
    kind = path.suffix.lower()
    if kind == ".npz":
        return [read_npz(path)]
    if kind == ".csv":
        return [read_csv(path)]
    if kind == ".scans":
        damage = Damage()
        found = read_recording(path, damage)
        if words := damage.in_words():
            say(f"{path}: {words}")
        return found
    if is_bag(path):
        return read_rosbag(path)
    path.open("rb").close()  # a file that is not there is said to be so
    raise ValueError("not a recording: its name ends in .scans, .npz, .csv, .bag, .db3 or .mcap")
