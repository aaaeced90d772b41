"""Weighing and reading take turns: the field of an antenna disturbs the converters of load cells."""

from __future__ import annotations

from tms_agents.devices.tags import Field

#: A reader that does not confirm in this time that its field is off is not waited for: better noise than blindness.
_CONFIRM_S = 1.0


class FieldTurns:
    """Switches one reader's field: off for ``weigh_s`` seconds, on until every antenna was asked, off again.

    ``tick`` is called often, ``round_over`` at the end of every round of the reader. ``quiet`` tells whether samples
    taken now are undisturbed.
    """

    def __init__(self, field: Field, weigh_s: float, antennas: int, *, read_s: float = 2.0) -> None:
        self._field, self._weigh_s, self._antennas, self._read_s = field, weigh_s, max(1, antennas), read_s
        self._reading_since: float | None = None
        self._paused_at: float | None = None
        self._off_since: float | None = None
        self._rounds = 0

    def tick(self, t: float) -> None:
        if self._reading_since is None:
            if self._paused_at is None:
                self._pause(t)
            elif self._off_since is None:
                if self._field.is_off or t - self._paused_at > _CONFIRM_S:
                    self._off_since = t
            elif t - self._off_since >= self._weigh_s:
                self._field.resume()
                self._reading_since, self._rounds = t, 0
        elif t - self._reading_since > self._read_s:
            self._pause(t)

    def round_over(self, t: float) -> None:
        self._rounds += 1
        if self._reading_since is not None and self._rounds >= self._antennas:
            self._pause(t)

    def quiet(self, t: float) -> bool:
        return self._reading_since is None and self._off_since is not None

    def _pause(self, t: float) -> None:
        self._field.pause()
        self._reading_since, self._off_since, self._paused_at = None, None, t
