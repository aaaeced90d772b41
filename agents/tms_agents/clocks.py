"""The times of an agent: one that never jumps for the estimators, and UTC for what is posted."""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import Any

log = logging.getLogger(__name__)
#: A clock that was set back by less is not worth a word.
_SAID_S = 1.0
#: Less is how long it takes to look at two clocks; so many times that one was set back count.
_NOISE_S, _SET_BACK = 1e-3, 20


class Clocks:
    """``now()`` is sensor time: seconds that run evenly and never go back, whatever happens to the computer's clock.

    It starts at the Unix time of the start, or a little after ``after`` (the last sensor time of the run before), so
    that what a former run remembers lies in the past. ``utc`` and ``in_step`` tell the time of day of a sensor time by
    the clock as it is set now. Those times never go back either: where the clock was set back, observations keep their
    order and the last time until the clock has caught up (``ahead_s`` tells how far). ``told`` is the last one of the
    run before: it holds over a restart, too.
    """

    def __init__(
        self,
        unix: Callable[[], float],
        even: Callable[[], float],
        *,
        after: float = float("-inf"),
        told: float = float("-inf"),
    ) -> None:
        self._unix, self._even = unix, even
        self._shift = max(unix(), after + 1e-3) - even()
        #: The last time of day that was told, and the sensor time of the clock's last one that was not behind that.
        self._latest, self._in_step = told, self.now()
        #: The same of every time when the clock was found set back.
        self._before: deque[tuple[float, float]] = deque(maxlen=_SET_BACK)
        self._offset, self._behind = unix() - self.now(), False

    @classmethod
    def resumed(cls, saved: Mapping[str, Any], unix: Callable[[], float], even: Callable[[], float]) -> Clocks:
        """After the run that left ``saved``: its last sensor time ``t``, and what it had ``told``."""
        found = [saved.get(name) for name in ("t", "told")]
        after, told = (
            float(one) if isinstance(one, int | float) and math.isfinite(one) else -math.inf for one in found
        )
        return cls(unix, even, after=after, told=told)

    def now(self) -> float:
        return self._even() + self._shift

    def utc(self, t: float) -> datetime:
        """Time of day of sensor time ``t``, not before any that was told already."""
        unix, now = self._look()
        self._latest = max(self._latest, unix - (now - t))
        return datetime.fromtimestamp(self._latest, UTC)

    def in_step(self, t: float) -> datetime:
        """Time of day of sensor time ``t``, which may be long past: in the order in which things happened.

        What happened after the clock was set back is all told for the last time before that, what happened before it
        for when it was.
        """
        unix, now = self._look()
        least = [latest - max(0.0, then - t) for latest, then in (*self._before, (self._latest, self._in_step))]
        return datetime.fromtimestamp(max(unix - (now - t), *least), UTC)

    @property
    def told(self) -> float:
        """The last time of day that was told (Unix); what comes is not told to have been before."""
        self._look()
        return self._latest

    @property
    def ahead_s(self) -> float:
        """How far the last time that was told is ahead of the clock, seconds; 0 unless the clock was set back."""
        return max(0.0, self._latest - self._unix())

    def _look(self) -> tuple[float, float]:
        """Unix and sensor time; whether the one is behind what was told."""
        unix, now = self._unix(), self.now()
        last = (self._latest, self._in_step)
        if unix - now < self._offset - _NOISE_S and (not self._before or self._before[-1] != last):
            self._before.append(last)
        self._offset = unix - now
        if unix >= self._latest:
            self._latest, self._in_step, self._behind = unix, now, False
        elif not self._behind and self._latest - unix > _SAID_S:
            self._behind = True
            until = datetime.fromtimestamp(self._latest, UTC).isoformat(timespec="seconds")
            log.warning(
                "the clock of this computer is %.0f s behind what was told already: until it has caught up, "
                "what happens is told for %s",
                self._latest - unix,
                until,
            )
        return unix, now
