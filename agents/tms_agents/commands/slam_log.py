"""What the commands of ``tms slam`` share: the log they read, the folder they write to, the threads they use."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np

from tms_agents.bags import is_bag, read_messages
from tms_agents.slam.log_files import read_log
from tms_agents.slam.logs import Log, parse_laser
from tms_agents.slam.logs_ros import TYPES, parse_messages
from tms_client.cli import CommandError


def add_log_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "log", type=Path, metavar="LOG", help="CARMEN .log or .clf, recording .jsonl (each may be .gz), ROS bag"
    )
    parser.add_argument(
        "--models", type=Path, metavar="MODELS.json", help="laser pose (default: models.json beside LOG)"
    )
    parser.add_argument("--threads", type=int, default=0, metavar="N", help="default: all cores; results are the same")


def read(arguments: argparse.Namespace) -> Log:
    """The log that the options name. Raises ``CommandError``."""
    return load(arguments.log, arguments.models)


def load(path: Path, models: Path | None) -> Log:
    """A log, with the laser where ``models`` says. Raises ``CommandError``."""
    try:
        log = parse_messages(read_messages(path, TYPES)) if is_bag(path) else read_log(path)
        if models is not None:
            log = replace(log, laser=parse_laser(models.read_text()))
    except OSError as error:
        raise CommandError(f"{error.filename or path}: {error.strerror or error}") from error
    except ValueError as error:
        raise CommandError(f"{path}: {error}") from error
    if log.bad_lines:
        sys.stderr.write(f"{path}: {log.bad_lines} lines could not be read and were left out\n")
    return log


def make_folder(folder: Path) -> None:
    """Raises ``CommandError``."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(f"{folder}: {error.strerror or error}") from error


def set_threads(wanted: int) -> None:
    """0: all cores. Raises ``CommandError``."""
    cores = numba.get_num_threads()
    if not 0 <= wanted <= cores:
        raise CommandError(f"--threads: from 1 to {cores}")
    numba.set_num_threads(wanted or cores)


def pose(text: str) -> tuple[float, float, float]:
    """An option like 1.5,0.2,1.57: x and y in m, theta in rad."""
    try:
        x, y, theta = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no pose like 1.5,0.2,1.57") from None
    if not np.isfinite([x, y, theta]).all():
        raise argparse.ArgumentTypeError(f"{text!r} is no pose like 1.5,0.2,1.57")
    return x, y, theta
