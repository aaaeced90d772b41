"""Ctrl-C that cannot get lost.

A signal handler raises wherever the program happens to be, also within an import or a callback of some library that
swallows everything. So it is remembered, too, and raised again when the story waits the next time.
"""

from __future__ import annotations

import signal
import time
from types import FrameType


class Leaving:
    def __init__(self) -> None:
        self._asked = False

    def listen(self) -> None:
        """From now on SIGINT, SIGTERM and SIGHUP raise KeyboardInterrupt."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._ask)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        self._asked = True
        raise KeyboardInterrupt

    def sleep(self, seconds: float) -> None:
        """Wait.

        Raises:
            KeyboardInterrupt: somebody asked to leave, now or before.
        """
        if self._asked:
            raise KeyboardInterrupt
        time.sleep(seconds)
