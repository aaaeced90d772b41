"""What a gripper's own sensors say: closed or open, and whether there is something between the fingers."""

from __future__ import annotations

from dataclasses import dataclass

#: A finger that moved less than this between messages stands still; sensor noise of an opening.
_STILL_M = 0.002


@dataclass(frozen=True, kw_only=True, slots=True)
class Grip:
    """One message about a gripper. What it does not measure is None; ``opening_m`` is the width between the fingers."""

    closed: bool | None = None
    opening_m: float | None = None
    effort: float | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class FingerSettings:
    """
    Args:
        open_m: a gripper that does not say whether it is closed is open from this width on.
        empty_m: closed to this width or less, there is nothing between the fingers.
        slack_m: hysteresis of both.
        hold_effort: closed with at least this effort it holds something (absolute value, the robot's own unit); used
            where the width is not measured. Below half of it there is nothing.
    """

    open_m: float = 0.08
    empty_m: float = 0.004
    slack_m: float = 0.002
    hold_effort: float | None = None


class Fingers:
    """Pure: messages in, their meaning with hysteresis out."""

    def __init__(self, settings: FingerSettings) -> None:
        self._settings = settings
        self.closed = False
        #: Something is between the fingers; None where no sensor tells.
        self.holds: bool | None = None
        #: Since when they are closed or open, since when they hold something or nothing, since when they stand still.
        self.closed_since = self.holds_since = self.still_since = float("-inf")
        self._width: float | None = None

    def update(self, t: float, grip: Grip) -> None:
        closed, holds = self._closed(grip), self._holds(grip)
        if closed != self.closed:
            self.closed, self.closed_since = closed, t
        if holds != self.holds:
            self.holds, self.holds_since = holds, t
        if grip.opening_m is not None and (self._width is None or abs(grip.opening_m - self._width) > _STILL_M):
            self._width, self.still_since = grip.opening_m, t

    def settled(self, t: float, seconds: float) -> bool:
        """They have neither changed nor moved for that long."""
        return t - max(self.closed_since, self.holds_since, self.still_since) >= seconds

    def _closed(self, grip: Grip) -> bool:
        if grip.closed is not None:
            return grip.closed
        if grip.opening_m is None:
            return self.closed
        return grip.opening_m < self._settings.open_m - (0.0 if self.closed else self._settings.slack_m)

    def _holds(self, grip: Grip) -> bool | None:
        settings = self._settings
        if grip.opening_m is not None:
            return grip.opening_m > settings.empty_m + (0.0 if self.holds else settings.slack_m)
        if settings.hold_effort is not None and grip.effort is not None:
            return abs(grip.effort) >= settings.hold_effort * (0.5 if self.holds else 1.0)
        return None
