"""The sensor's clock, which begins again every 4 h 39 min, on one line."""

from __future__ import annotations

from tms_agents.devices.scip.measurements import STAMP_TURN_MS

#: The two clocks may differ by so much since the last stamp before the sensor's must have been set anew: the host may
#: be busy for long. Where the sensor may have been restarted it is more likely that it was.
_TOLERANCE_MS, _DOUBTFUL_MS = 60_000.0, 500.0


class DeviceClock:
    """Unwraps stamps with the help of the host's clock: any pause is bridged, also of many turns.

    A sensor that was restarted counts from 0 again; its time then goes on here as the host's clock has gone on.
    """

    def __init__(self) -> None:
        self._last: tuple[int, float] | None = None
        self._time_ms = 0.0

    def unwrap(self, stamp_ms: int, now_s: float, *, doubtful: bool = False) -> float:
        """Seconds; the first call gives the stamp as it is. ``doubtful``: the sensor may have been restarted."""
        if self._last is None:
            self._time_ms = float(stamp_ms)
        else:
            last, then_s = self._last
            elapsed_ms = 1000 * (now_s - then_s)
            step = (stamp_ms - last) % STAMP_TURN_MS
            step += round((elapsed_ms - step) / STAMP_TURN_MS) * STAMP_TURN_MS
            goes_on = abs(step - elapsed_ms) < (_DOUBTFUL_MS if doubtful else _TOLERANCE_MS)
            self._time_ms += step if goes_on else max(elapsed_ms, 0.0)
        self._last = stamp_ms, now_s
        return self._time_ms / 1000
