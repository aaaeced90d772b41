"""When a scan was made: the laser's own clock, tied to ours by the scans that took the shortest way."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from tms_agents.devices.scans import Scan, Sweep

#: The shortest way is looked for among the scans of this long; a clock that runs wrong by 100 ppm is off by 6 ms then.
_BUCKET_S, _BUCKETS = 10.0, 6
_LEAST_STEP_S = 1e-3


class ScanTimes:
    """Times of the first beams of one laser's scans, in seconds of our clock; they always rise.

    A scan comes with a delay that is never below some least one: the turn of the mirror itself and the line. The least
    difference of arrival and device time seen lately ties the clocks. Where the laser has no clock the arrival alone
    counts; where its clock was set back, it is tied anew. No time is before ``after``.
    """

    def __init__(self, after: float = float("-inf")) -> None:
        self._least: deque[tuple[float, float]] = deque(maxlen=_BUCKETS)
        self._device, self._last = float("-inf"), after

    def of(self, arrival: float, scans: Sequence[Scan]) -> list[float]:
        """Of scans that arrived together at ``arrival``, the oldest first."""
        return [
            self._one(arrival - (len(scans) - n) * scan.sweep.period_s, arrival, scan)
            for n, scan in enumerate(scans, 1)
        ]

    def _one(self, spread: float, arrival: float, scan: Scan) -> float:
        """``spread``: when it would have arrived if it had not waited for others."""
        turn = turn_s(scan.sweep)
        t = (
            spread - turn
            if scan.device_time_s is None
            else scan.device_time_s + self._tie(arrival, scan.device_time_s) - turn
        )
        self._last = max(t, self._last + _LEAST_STEP_S)
        return self._last

    def _tie(self, arrival: float, device: float) -> float:
        if device <= self._device:
            self._least.clear()
        self._device = device
        difference = arrival - device
        if not self._least or arrival - self._least[-1][0] >= _BUCKET_S:
            self._least.append((arrival, difference))
        elif difference < self._least[-1][1]:
            self._least[-1] = (self._least[-1][0], difference)
        return min(least for _, least in self._least)


def turn_s(sweep: Sweep) -> float:
    """From the first beam to the last."""
    return abs(sweep.time_increment_s) * (len(sweep.angles) - 1)
