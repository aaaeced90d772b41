"""``tms slam compare``: do two trajectories, or a trajectory and known relations, agree?"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from tms_agents.slam.export import paths_picture
from tms_agents.slam.geometry import Floats, between, compose
from tms_agents.slam.metric import agreement_with, read_relations, read_trajectory, relations_of
from tms_client.cli import CommandError


def compare(arguments: argparse.Namespace) -> int:
    """Prints the agreement; with two trajectories, a picture of both, laid over one another where they begin to be at
    the same time."""
    a = _read(arguments.a, trajectory=True)
    odometry = None if arguments.odom is None else _read(arguments.odom, trajectory=True)
    relations = arguments.b.name.removesuffix(".gz").endswith(".relations")
    b = _read(arguments.b, trajectory=not relations)
    if not relations:
        b = b[(b[:, 0] >= a[:, 0].min()) & (b[:, 0] <= a[:, 0].max())]
        if len(b) < 2:
            raise CommandError("the two trajectories have no time in common")
    found = agreement_with(b if relations else relations_of(b), a, odometry)
    sys.stdout.write(
        f"{found.relations} relations: {found.translation:.4f} +- {found.translation_deviation:.4f} m "
        f"(worst {found.translation_worst:.3f}), {found.rotation:.3f} +- {found.rotation_deviation:.3f} deg\n"
    )
    if not relations:
        folder = arguments.a if arguments.a.is_dir() else arguments.a.parent
        png = arguments.png or folder / "compare.png"
        same = a[np.argmin(np.abs(a[:, 0] - b[0, 0])), 1:]
        laid = compose(same[None], between(b[:1, 1:], b[:, 1:]))
        try:
            Image.fromarray(paths_picture([a[:, 1:3], np.asarray(laid)[:, :2]])).save(png)
        except OSError as error:
            raise CommandError(f"{png}: {error.strerror or error}") from error
    return 0


def _read(path: Path, *, trajectory: bool) -> Floats:
    file = path / "trajectory.txt" if path.is_dir() else path
    try:
        return read_trajectory(file) if trajectory else read_relations(file)
    except OSError as error:
        raise CommandError(f"{file}: {error.strerror or error}") from error
    except (ValueError, EOFError) as error:
        raise CommandError(f"{file}: {str(error).splitlines()[0]}") from error
