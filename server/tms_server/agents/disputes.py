"""Agents whose numbers are taken by other observations: two run under one name.

Each loses what the other was first with. Both would be shown as one that is connected, and only the log of the one that
is refused would tell. What is known here is forgotten with the server: who runs on is refused again soon.
"""

from __future__ import annotations

from datetime import datetime

#: Each posts its state every ten seconds or so, and one of them is refused then.
_LASTS_S = 60.0


class Disputes:
    """When an agent was last refused a number, and what was said."""

    def __init__(self) -> None:
        self._refused: dict[str, tuple[datetime, str]] = {}

    def note(self, agent: str, why: str, now: datetime) -> None:
        self._refused = {name: one for name, one in self._refused.items() if _lasts(one[0], now)}
        self._refused[agent] = now, why

    def of(self, agent: str, now: datetime) -> str:
        """What is wrong with its name, for people; empty where nothing is."""
        at, why = self._refused.get(agent, (None, ""))
        if at is None or not _lasts(at, now):
            return ""
        return f"does another agent run under this name? Each needs its own. Refused at {at:%H:%M:%S}: {why}"


def _lasts(at: datetime, now: datetime) -> bool:
    return abs((now - at).total_seconds()) < _LASTS_S
