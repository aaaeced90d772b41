"""A pose that goes on: out of raw positions that wrap around, through resets of the robot and lost packets."""

from __future__ import annotations

import math

#: Raw positions have 15 bits, headings 4096 to the turn.
POSITION_TURN, HEADING_TURN = 1 << 15, 4096
#: No such robot is faster (m/s); so far it may be off all the same (m).
_FASTEST_M_S, _SLACK_M = 2.5, 0.3

Raw = tuple[int, int, int]


class Odometry:
    """Shared by the sessions of a link, so that ``pose`` (m, m, rad unwrapped) goes on after an interruption.

    Two raw positions tell how the robot moved between them, seen from itself. A jump that no robot can make, as after
    a reset, is no motion; nor is what happened while nobody listened (the robot stops by itself after two seconds).
    """

    def __init__(self) -> None:
        self.pose = (0.0, 0.0, 0.0)
        #: Jumps that were no motion.
        self.resets = 0
        self._raw: Raw | None = None
        self._at = 0.0

    def anchor(self) -> None:
        """The next raw position is where the robot is now, whatever it says."""
        self._raw = None

    def take(self, raw: Raw, at: float, mm_per_unit: float) -> tuple[float, float, float]:
        """Raw x, y, heading at time ``at`` (s); the pose now."""
        before, self._raw = self._raw, raw
        since, self._at = at - self._at, at
        if before is None:
            return self.pose
        dx, dy = (_nearest(raw[i] - before[i], POSITION_TURN) * mm_per_unit / 1000 for i in (0, 1))
        turn = _nearest(raw[2] - before[2], HEADING_TURN) * math.tau / HEADING_TURN
        if math.hypot(dx, dy) > _FASTEST_M_S * since + _SLACK_M:
            self.resets += 1
            return self.pose
        heading = before[2] * math.tau / HEADING_TURN
        ahead = math.cos(heading) * dx + math.sin(heading) * dy
        aside = math.cos(heading) * dy - math.sin(heading) * dx
        x, y, theta = self.pose
        self.pose = (
            x + math.cos(theta) * ahead - math.sin(theta) * aside,
            y + math.sin(theta) * ahead + math.cos(theta) * aside,
            theta + turn,
        )
        return self.pose


def _nearest(difference: int, turn: int) -> int:
    """The same but for whole turns, from -turn/2 to turn/2."""
    return (difference + turn // 2) % turn - turn // 2
