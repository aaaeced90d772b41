"""A SCIP session and an emulated sensor that talk without a line, on a clock of their own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from device_conversation import Clock

from tms_agents.devices.scans import Scan
from tms_agents.devices.scip import ScipDevice, ScipSession, ScipSettings


def room(steps: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Ranges in whole millimetres with a far and a failed beam, and intensities."""
    random = np.random.default_rng(seed)
    ranges = random.integers(100, 4000, steps) / 1000
    ranges[[3, 50]] = np.inf
    ranges[[5, 60, 61]] = np.nan
    return ranges, random.integers(0, 5000, steps).astype(float)


class Sensor:
    """A sensor in a room and who listens to it."""

    def __init__(self, model: str = "UST-20LX", settings: ScipSettings | None = None, **options) -> None:
        self.clock = Clock()
        self.settings = settings
        self.device = ScipDevice(lambda: self.seen, model, clock=self.clock, **options)
        self.seen: tuple[np.ndarray, np.ndarray | None] = room(self.device.model.parameters.steps)
        self.connect()

    def connect(self) -> ScipSession:
        """The host begins anew; the sensor goes on."""
        self.session = ScipSession(self.settings, clock=self.clock)
        self.session.opened()
        return self.session

    def scans(self, seconds: float, *, step_s: float = 0.005, line: Callable[[bytes], bytes] = bytes) -> list[Scan]:
        """Everything delivered in that time; ``line`` may damage what the sensor sends."""
        found: list[Scan] = []
        for _ in range(round(seconds / step_s)):
            self.clock.now += step_s
            if said := line(self.device.receive(self.session.output()) + self.device.tick()):
                found += self.session.receive(said)
            self.session.tick()
        return found

    def is_seen(self, scan: Scan) -> bool:
        """Whether a scan is what stands before the sensor."""
        ranges, intensities = self.seen
        light = scan.intensities is None or np.array_equal(scan.intensities, intensities)
        return bool(light and np.allclose(scan.ranges, ranges, rtol=0, atol=1e-9, equal_nan=True))
