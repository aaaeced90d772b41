"""Whoever asks the demo to leave is heard."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator

import pytest

from tms_agents.simulation.leaving import Leaving

NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@pytest.fixture
def leaving() -> Iterator[Leaving]:
    before = [signal.getsignal(number) for number in NUMBERS]
    one = Leaving()
    one.listen()
    yield one
    for number, handler in zip(NUMBERS, before, strict=True):
        signal.signal(number, handler)


@pytest.mark.parametrize("number", NUMBERS)
def test_an_interrupt_that_was_swallowed_is_raised_again(leaving: Leaving, number: signal.Signals) -> None:
    leaving.sleep(0.0)
    with contextlib.suppress(BaseException):  # as a callback of some library does
        signal.raise_signal(number)
    with pytest.raises(KeyboardInterrupt):
        leaving.sleep(60.0)
