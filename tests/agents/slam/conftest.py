"""A small building, driven through twice, for all tests of mapping."""

from __future__ import annotations

from collections.abc import Iterator

import numba
import pytest

from tms_agents.simulation.building import Drive, Driven, carmen, drive
from tms_agents.slam import Log
from tms_agents.slam.logs_carmen import parse_carmen


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Threads that wait for each other are slow where other tests run beside."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    yield
    numba.set_num_threads(before)


@pytest.fixture(scope="session")
def driven() -> Driven:
    return drive("block", Drive(seed=3, step_m=0.6))


@pytest.fixture(scope="session")
def log(driven: Driven) -> Log:
    return parse_carmen(carmen(driven))
