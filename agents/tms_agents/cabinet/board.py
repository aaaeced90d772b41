"""One board of a cabinet: samples in, events and a state out."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from tms_agents.cabinet import CabinetEstimator, CabinetEvent, KnownWeight
from tms_agents.cabinet.calibration_file import BoardCalibration
from tms_agents.cabinet.config import BoardSection
from tms_agents.cabinet.continuity import Continuity
from tms_agents.cabinet.geometry import Zone
from tms_agents.cabinet.single import single_loads
from tms_agents.devices.loads import LoadSample
from tms_agents.devices.transport import DeviceState

log = logging.getLogger(__name__)
#: A fault is told when the samples were bad for so long (an answer may be late on a busy computer), and is over when
#: they were good for so long: states that flicker tell nothing.
_BAD_S, _GOOD_S = 0.5, 1.0
#: A filtered device repeats its number at rest. This much, one way and the other, tells that from a stuck cell.
_DITHER_G = 1e-3


class Board:
    """``calibration`` None: the device delivers grams."""

    def __init__(self, section: BoardSection, calibration: BoardCalibration | None, zones: Mapping[str, Zone]) -> None:
        self.section, self.calibration, self.zones = section, calibration, dict(zones)
        self.geometry, self.settings = section.geometry(calibration), section.settings()
        self.estimator = CabinetEstimator(self.geometry, self.settings, zones=self.zones)
        self._continuity = Continuity(section.cell_count, zeroes_itself=section.zeroes_itself)
        self._filtered = all(one.filtered for one in section.load)
        self._dither = _DITHER_G
        self._link: DeviceState | None = None
        self._fault = ""
        #: When the samples were good last, and bad last.
        self._good_at: float | None = None
        self._bad_at = float("-inf")
        #: Grams of every cell of the device at the last sample, NaN where unusable.
        self.grams = [math.nan] * section.cell_count

    @property
    def name(self) -> str:
        return self.section.name

    @property
    def state(self) -> DeviceState | None:
        """The worse of the line's state and what the samples say; None before the line said anything."""
        if self._link is None:
            return None
        if self._link.state == "connected" and self._fault:
            return DeviceState("faulty", f"{self.name}: {self._fault}")
        return DeviceState(self._link.state, f"{self.name}: {self._link.why}")

    def line(self, t: float, state: DeviceState) -> None:
        """The line to the device is in a new state."""
        if state.state != "connected":
            self._continuity.interrupted()
            self.estimator.load(t, np.full(self.geometry.count, np.nan))
            self.grams = [math.nan] * len(self.grams)
            self._fault, self._good_at = "", None
        self._link = state

    def sample(self, t: float, sample: LoadSample) -> list[CabinetEvent]:
        """One sample at sensor time ``t``."""
        count = len(sample.values)
        if count != len(self.grams):
            self._failing(t, f"{count} values for {len(self.grams)} cells")
            return []
        raw = list(sample.values) if self.calibration is None else self.calibration.grams(sample.values)
        grams = self._continuity.take(t, raw)
        if grams is None:
            return []
        self.grams = grams
        events = self.estimator.load(t, self._for_estimator(grams))
        self._judge(t, sample)
        return events

    def inventory(self, t: float, zone: str, tags: frozenset[str]) -> list[CabinetEvent]:
        return self.estimator.inventory(t, zone, tags) if zone in self.zones else []

    def know(self, tag: str, weight: KnownWeight) -> None:
        self.estimator.know(tag, weight)

    def to_dict(self) -> dict[str, Any]:
        return {"estimator": self.estimator.to_dict(), "zero": self._continuity.to_dict()}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on from what a former run saved.

        Raises:
            ValueError, KeyError, TypeError: it does not fit this board.
        """
        estimator = CabinetEstimator.from_dict(saved["estimator"], self.geometry, self.settings, zones=self.zones)
        self._continuity.restore(saved["zero"]["shift"], saved["zero"]["level"])
        self.estimator = estimator

    def _for_estimator(self, grams: list[float]) -> list[float]:
        if self.section.cells is None:
            grams = single_loads(grams)
        if self._filtered or self.section.cells is None:
            self._dither = -self._dither
            grams = [one + self._dither for one in grams]
        return grams

    def _judge(self, t: float, sample: LoadSample) -> None:
        fault = sample.fault
        if not fault and (bad := self._unusable()):
            fault = f"cell {', '.join(map(str, bad))} does not measure"
        if fault:
            self._failing(t, fault)
            return
        self._good_at = t
        if self._fault and t - self._bad_at > _GOOD_S:
            self._fault = ""

    def _failing(self, t: float, fault: str) -> None:
        self._bad_at = t
        if self._good_at is None:
            self._good_at = t
        if self._fault or t - self._good_at >= _BAD_S:
            self._fault = fault

    def _unusable(self) -> list[int]:
        """Cells that deliver nothing or the same number for too long."""
        bad = {cell for cell, grams in enumerate(self.grams) if not math.isfinite(grams)}
        if not self._filtered and self.section.cells is not None:
            bad.update(self.estimator.unusable_cells)
        return sorted(bad)
