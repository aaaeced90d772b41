"""A short corridor, coloured and not, driven there and back."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tms_agents.simulation.coloured import corridor
from tms_agents.simulation.coloured_drive import Recording, drive_through
from tms_agents.slam import Log
from tms_agents.slam.logs_recording import parse_recording

Drive = tuple[Recording, Log]


@pytest.fixture(scope="session")
def drives() -> Callable[[bool], Drive]:
    made: dict[bool, Drive] = {}

    def drive(coloured: bool) -> Drive:
        if coloured not in made:
            random = np.random.default_rng(7)
            recording = drive_through(corridor(random, coloured=coloured, length=20.0), random)
            made[coloured] = recording, parse_recording(recording.lines, recording.models)
        return made[coloured]

    return drive


@pytest.fixture(scope="session")
def coloured(drives: Callable[[bool], Drive]) -> Drive:
    return drives(True)


@pytest.fixture(scope="session")
def plain(drives: Callable[[bool], Drive]) -> Drive:
    return drives(False)
