"""One laser of the floor agent: how it is mounted, its times, and whether what it delivers can be used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tms_agents.devices.scans import Array, Scan, Sweep
from tms_agents.devices.transport import DeviceState
from tms_agents.floor.config import LaserSection
from tms_agents.floor.outlook import Outlook
from tms_agents.floor.recordings.clock import ScanTimes
from tms_agents.floor.settings import Polygon, Pose, Sensor

#: Blind or stuck for so long is a fault; a hand that passes the window is none.
_FAULT_S = 2.0
_NEAR_M, _BLIND_SHARE, _ERROR_SHARE = 0.15, 0.5, 0.9


class Laser:
    """``pose`` as calibrated, or as the configuration says. No scan is from before ``after``.

    ``region``: where labels are wanted, if it is to see some of it.
    """

    def __init__(
        self,
        section: LaserSection,
        pose: Pose | None = None,
        *,
        after: float = float("-inf"),
        region: Polygon | None = None,
    ) -> None:
        self.section = section
        self.pose = pose or section.pose.pose
        self.times = ScanTimes(after)
        self.sweep: Sweep | None = None
        #: The newest scan, for pictures, and how many there were.
        self.ranges: Array | None = None
        self.scans = 0
        self._line: DeviceState | None = None
        self._trouble = ""
        self._well_at: float | None = None
        self._own: tuple[Sweep, Sweep] | None = None
        self._outlook = None if region is None else Outlook(region, self.pose)

    def line(self, state: DeviceState) -> None:
        self._line = DeviceState(state.state, f"{self.section.name}: {state.why}")
        if state.state != "connected":
            self._well_at = None

    @property
    def state(self) -> DeviceState | None:
        """Of the line, and of what comes over it."""
        if self._trouble and self._line is not None and self._line.state == "connected":
            return DeviceState("faulty", f"{self.section.name}: {self._trouble}")
        return self._line

    def _looks(self, scan: Scan) -> str:
        """Who stands before it is no reason, nor is who passes one: one beam that gets there is enough, once."""
        if self._outlook is not None:
            self._outlook.look(scan.sweep, scan.ranges)
            if not self._outlook.sees:
                return _ELSEWHERE
        return ""

    def mounted(self, scan: Scan) -> Scan:
        """The scan as of a laser the right way up, with the reach that is wanted; its sweep stays the same object."""
        if self._own is None or not same_sweep(self._own[0], scan.sweep):
            self._own = scan.sweep, self._mounted(scan.sweep)
        return replace(scan, sweep=self._own[1])

    def sensor(self, sweep: Sweep) -> Sensor:
        """What the estimator is told of it."""
        return Sensor(sweep, self.pose, self.section.range_scale)

    def usable(self, t: float, scan: Scan) -> bool:
        """Whether the scan says anything about the room; where not for long, ``state`` says why not."""
        trouble = self._judge(scan) or self._looks(scan)
        self.sweep, self.ranges = scan.sweep, scan.ranges
        self.scans += 1
        if not trouble or self._well_at is None:
            self._well_at = t
        # A scan that is the same as the one before says the same; only at length it is strange.
        late = t - self._well_at >= _FAULT_S
        self._trouble = trouble if late else ""
        return trouble in ("", _ELSEWHERE) or (trouble == _STUCK and not late)

    def _judge(self, scan: Scan) -> str:
        ranges = scan.ranges
        with np.errstate(invalid="ignore"):
            near = float(np.mean(ranges < _NEAR_M))
        if near > _BLIND_SHARE:
            return f"{near:.0%} of the beams end at its window: something covers it"
        if (errors := float(np.mean(np.isnan(ranges)))) > _ERROR_SHARE:
            return f"{errors:.0%} of the beams are errors"
        echoes = bool(np.isfinite(ranges).any())
        if echoes and self.ranges is not None and np.array_equal(ranges, self.ranges, equal_nan=True):
            return _STUCK
        return ""

    def _mounted(self, sweep: Sweep) -> Sweep:
        reach = min(sweep.range_max_m, self.section.range_max_m or np.inf)
        return replace(sweep, angles=-sweep.angles if self.section.upside_down else sweep.angles, range_max_m=reach)


_STUCK = "it repeats one scan"
_ELSEWHERE = "it sees nothing of the region: is its pose right, and [scene] region?"


def same_sweep(one: Sweep, other: Sweep) -> bool:
    """Whether scans of both can be compared beam by beam."""
    if one is other:
        return True
    same = (one.range_min_m, one.range_max_m, one.model) == (other.range_min_m, other.range_max_m, other.model)
    return same and one.angles.shape == other.angles.shape and bool(np.allclose(one.angles, other.angles, atol=1e-6))
