"""The times of an agent: one that never jumps for the estimators, and UTC for what is posted."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime


class Clocks:
    """``now()`` is sensor time: seconds that run evenly and never go back, whatever happens to the computer's clock.

    It starts at the Unix time of the start, or a little after ``after`` (the last sensor time of the run before), so
    that what a former run remembers lies in the past. ``utc`` tells the time of day of a sensor time by the clock as it
    is set now. Those times never go back either: where the clock was set back, observations keep their order and the
    last time until the clock has caught up (``ahead_s`` tells how far).
    """

    def __init__(self, unix: Callable[[], float], even: Callable[[], float], *, after: float = float("-inf")) -> None:
        self._unix, self._even = unix, even
        self._shift = max(unix(), after + 1e-3) - even()
        self._latest = float("-inf")

    def now(self) -> float:
        return self._even() + self._shift

    def utc(self, t: float) -> datetime:
        """Time of day of sensor time ``t``, not before any that was told already."""
        at = self._unix() - (self.now() - t)
        self._latest = max(self._latest, at)
        return datetime.fromtimestamp(self._latest, UTC)

    @property
    def shift_s(self) -> float:
        """What makes a sensor time of the past a Unix time, in step with the times that were told already."""
        return self._unix() + self.ahead_s - self.now()

    @property
    def ahead_s(self) -> float:
        """How far the last time that was told is ahead of the clock, seconds; 0 unless the clock was set back."""
        return max(0.0, self._latest - self._unix())
