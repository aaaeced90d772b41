"""Is the robot localised? Said late rather than wrongly, and taken back when the scans cease to fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tms_agents.slam.fit import NEAR, UNKNOWN, WRONG
from tms_agents.slam.geometry import Floats
from tms_agents.slam.hypotheses import Hypothesis


@dataclass(frozen=True, slots=True)
class Limits:
    """When a pose is believed: one hypothesis has ``weight``, spreads at most ``spread_m`` and ``spread_rad``, and
    ``share`` of the beams that end where the map knows something fit; for ``confirm_m`` of way and ``confirm_scans``.

    Before that, and every ``again_scans`` after it (sooner where the share fell by ``worse``), other places are looked
    for: they must fit worse by ``margin`` (mean cost per beam) and by ``sigmas`` standard errors, more where few scans
    are remembered, or by ``clear``. A pose ceases to be believed where its weight falls below ``doubt_weight``, the
    share (averaged) below ``doubt_share``, the spread doubles, another place fits better by as much, or for
    ``blind_m`` of way nothing was seen that the map knows.
    """

    weight: float = 0.95
    spread_m: float = 0.3
    spread_rad: float = 0.15
    share: float = 0.65
    confirm_m: float = 2.0
    confirm_scans: int = 5
    doubt_weight: float = 0.6
    doubt_share: float = 0.5
    margin: float = 0.03
    sigmas: float = 2.3
    clear: float = 0.25
    again_scans: int = 20
    worse: float = 0.05
    blind_m: float = 3.0
    #: Of the beams, at least so many must end in known places to say anything.
    seen: float = 0.4
    #: Averages of the share follow the newest scan by so much (Thrun et al. 2005, table 8.3).
    slow: float = 0.03
    fast: float = 0.3
    #: The fast average falls below the slow one by this share: the robot may have been carried away.
    alarm: float = 0.15


class Verdict:
    """Fed with the best hypothesis after every scan."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.localised = False
        self._slow = self._fast = float("nan")
        self._since_m = self._blind_m = 0.0
        self._agreed = self._unasked = 0

    @property
    def surprise(self) -> float:
        """0..1: by how much the scans of late fit worse than those before; 0 below the alarm."""
        if not np.isfinite(self._slow) or self._slow <= 0.0:
            return 0.0
        fallen = max(0.0, 1.0 - self._fast / self._slow)
        return fallen if fallen >= self._limits.alarm else 0.0

    @property
    def asks(self) -> bool:
        """Is it time to look for rivals?"""
        limits = self._limits
        if self.localised:
            worse = self._fast < self._slow - limits.worse
            return self._unasked >= (limits.confirm_scans if worse else limits.again_scans)
        ripe = self._agreed >= limits.confirm_scans and self._since_m >= limits.confirm_m
        return ripe and self._unasked >= limits.confirm_scans

    def judge(self, best: Hypothesis, fit: Floats, driven_m: float) -> None:
        """``fit`` (4,) of the newest scan at ``best``; ``driven_m`` since the scan before."""
        limits = self._limits
        self._unasked += 1
        share = share_of(fit, limits.seen)
        self._blind_m = self._blind_m + driven_m if share is None else 0.0
        if share is not None:
            self._slow = share if np.isnan(self._slow) else self._slow + limits.slow * (share - self._slow)
            self._fast = share if np.isnan(self._fast) else self._fast + limits.fast * (share - self._fast)
        if self.localised:
            if self._doubtful(best):
                self._give_up()
            return
        narrow = best.spread_m <= limits.spread_m and best.spread_rad <= limits.spread_rad
        if best.weight >= limits.weight and narrow and share is not None and self._fast >= limits.share:
            self._agreed += 1
            self._since_m += driven_m
        else:
            self._agreed, self._since_m = 0, 0.0

    def answer(self, margin: float, sigmas: float, heard: float) -> None:
        """The best rival is behind by ``margin``, ``sigmas`` standard errors, in a share ``heard`` 0..1 of the scans
        that should be remembered."""
        limits = self._limits
        self._unasked = 0
        if self.localised and margin < -limits.margin and sigmas < -1.0:
            self._give_up()
        elif not self.localised and (
            margin >= limits.clear or (margin >= limits.margin and sigmas * np.sqrt(heard) >= limits.sigmas)
        ):
            self.localised = True
            self._slow = self._fast

    def _doubtful(self, best: Hypothesis) -> bool:
        limits = self._limits
        wide = best.spread_m > 2 * limits.spread_m or best.spread_rad > 2 * limits.spread_rad
        blind = self._blind_m >= limits.blind_m
        return best.weight < limits.doubt_weight or wide or blind or self._fast < limits.doubt_share

    def _give_up(self) -> None:
        self.localised = False
        self._agreed, self._since_m = 0, 0.0


def share_of(fit: Floats, seen: float) -> float | None:
    """Of the beams that end where the map knows something, the share that fits; None where they are too few."""
    known = float(fit[NEAR] + fit[WRONG])
    return float(fit[NEAR]) / known if known >= seen and fit[UNKNOWN] <= 1.0 - seen else None
