"""From many reports of one tag to visits: the tag in view without a gap longer than ``gap_s``."""

from __future__ import annotations

from datetime import datetime, timedelta

_PRUNE_AT = 10_000


class Visits:
    """Pure: times come with the reports, in any order; memory holds only tags seen within the last gap."""

    def __init__(self, gap_s: float) -> None:
        self._gap = timedelta(seconds=gap_s)
        self._open: dict[tuple[str, str], tuple[datetime, datetime]] = {}
        self._prune_at = _PRUNE_AT

    def see(self, zone: str, tag: str, first: datetime, last: datetime) -> bool:
        """Take one report, ``first`` to ``last`` (UTC); True where a new visit begins at ``first``."""
        known = self._open.get((zone, tag))
        # Both ways, so that a clock set back does not glue everything after it to the visit before.
        new = known is None or first > known[1] + self._gap or last < known[0] - self._gap
        if known is None or new:
            self._open[zone, tag] = (first, last)
        else:
            self._open[zone, tag] = (min(first, known[0]), max(last, known[1]))
        if len(self._open) > self._prune_at:
            self._prune(last)
        return new

    def __len__(self) -> int:
        return len(self._open)

    def _prune(self, now: datetime) -> None:
        self._open = {key: span for key, span in self._open.items() if abs(now - span[1]) <= self._gap}
        self._prune_at = max(_PRUNE_AT, 2 * len(self._open))
