"""A floor without I/O: scans and states of its lasers go in, observations, states and what is seen come out."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np

from tms_agents.clocks import Clocks
from tms_agents.devices.scans import Scan, Sweep
from tms_agents.devices.transport import DeviceState
from tms_agents.floor import FloorEstimator, FloorEvent, FloorLabel, Sensor
from tms_agents.floor.config import FloorConfig
from tms_agents.floor.labels import Labels
from tms_agents.floor.lasers import Laser, same_sweep
from tms_agents.floor.settings import Pose
from tms_agents.floor.story import told
from tms_schemas.observation import Inventory, Observation

log = logging.getLogger(__name__)
_STORY = 100
#: At the start, lasers that were never seen before may take so long to tell how they sweep.
_GATHER_S = 5.0
_REST_S = 0.25


class Floor:
    """``new_label`` gives ids that were never used; ``saved`` is what ``to_dict`` of a former run gave, or nothing.

    Not for several threads at once, except for ``line`` and ``states``.
    """

    def __init__(
        self,
        config: FloorConfig,
        poses: Mapping[str, Pose],
        clocks: Clocks,
        new_label: Callable[[], str],
        saved: Mapping[str, Any] | None = None,
    ) -> None:
        self.config, self._clocks = config, clocks
        # What a mirror shows of the region is not looked for.
        region = None if config.scene.mirrors else config.scene.region
        self.lasers = {
            one.name: Laser(one, poses.get(one.name), after=clocks.now(), region=region) for one in config.lasers
        }
        self.labels = Labels(
            new_label,
            clocks.in_step,
            report_m=config.report_m,
            report_s=config.report_s,
            tells_robots=config.tells_robots,
        )
        self.estimator: FloorEstimator | None = None
        self._sensors: dict[str, Sensor] = {}
        self._first_at: float | None = None
        self._rest_at = -np.inf
        self._anew = False
        #: Lasers that are known to stand elsewhere than is given.
        self._placed: set[str] = set()
        #: What happened of late, for people: time of day and one line.
        self.story: deque[tuple[datetime, str]] = deque(maxlen=_STORY)
        #: Called with every scan that came (laser, time, scan), for recordings.
        self.hear: Callable[[str, Pose, float, Scan], None] = lambda *_: None
        if saved:
            self._restore(saved)

    def scans(self, laser: str, arrival: float, scans: Sequence[Scan]) -> list[Observation]:
        """Scans that arrived together at ``arrival`` (sensor time), the oldest first; what is to be posted."""
        one = self.lasers[laser]
        mounted = [one.mounted(scan) for scan in scans]
        found: list[Observation] = []
        for t, scan in zip(one.times.of(arrival, mounted), mounted, strict=True):
            self.hear(laser, one.pose, t, scan)
            usable = one.usable(t, scan)
            if usable and self._knows(laser, t, scan.sweep) and self.estimator is not None:
                found += self._restart()
                found += self._observations(self.estimator.scan(laser, t, scan.ranges, scan.intensities))
                if t - self._rest_at >= _REST_S:
                    self._rest_at = t
                    found += self.labels.rest(t)
                    self._tell_places()
        return found

    def line(self, laser: str, state: DeviceState) -> None:
        self.lasers[laser].line(state)

    def states(self) -> dict[str, DeviceState]:
        """Of every laser by name, once something is known of it."""
        found = {f"laser {name}": one.state for name, one in self.lasers.items()}
        return {name: state for name, state in found.items() if state is not None}

    def seen(self) -> list[FloorLabel]:
        """Everything that has a label now."""
        return [] if self.estimator is None else self.estimator.labels() + self.estimator.awaited()

    def believed(self, laser: str) -> tuple[Pose, float]:
        """Where the laser stands, and what it measures times this is how far it is, as far as is known now."""
        one = self.lasers[laser]
        if self.estimator is None or laser not in self._sensors:
            return one.pose, one.section.range_scale or 1.0
        return self.estimator.poses()[laser], self.estimator.range_scales()[laser]

    def inventory(self) -> Inventory:
        now = self._clocks.now()
        labels = self.labels.inventory(self.seen(), now)
        return Inventory(seq=0, observed_at=self._clocks.in_step(now), labels=labels)

    def to_dict(self) -> dict[str, Any]:
        if self.estimator is None:
            return {"t": self._clocks.now()}
        return {
            "t": self._clocks.now(),
            "sweeps": {name: sensor.sweep.to_json() for name, sensor in self._sensors.items()},
            "poses": {name: list(sensor.pose) for name, sensor in self._sensors.items()},
            "labels": self.labels.to_dict(),
            "estimator": self.estimator.to_dict(),
        }

    # below: inside

    def _observations(self, events: Sequence[FloorEvent]) -> list[Observation]:
        if not events:
            return []
        found = self.labels.observations(events)
        for event in events:
            if (text := told(event)) is not None:
                self.story.append((self._clocks.in_step(event.t), text))
        return found

    def _tell_places(self) -> None:
        """Say once of each laser that it stands elsewhere than is given, or measures otherwise."""
        for name in sorted(self._sensors.keys() - self._placed):
            (x, y, theta), scale = self.believed(name)
            given = self.lasers[name]
            if (x, y, theta) != given.pose or scale != (given.section.range_scale or 1.0):
                self._placed.add(name)
                told = f"it stands at x = {x:.3f}, y = {y:.3f}, theta = {theta:.4f}"
                longer = f"{100 * (1 / scale - 1):+.1f}"
                if float(longer):  # most lasers only stand elsewhere
                    told += f" and measures {longer} % too long"
                log.info("laser %s: as the room tells, %s", name, told)

    def _knows(self, laser: str, t: float, sweep: Sweep) -> bool:
        """Whether the estimator knows this laser; it begins when all have told how they sweep, or the first waited."""
        known = self._sensors.get(laser)
        if self.estimator is not None and known is not None and same_sweep(known.sweep, sweep):
            return True
        self._first_at = t if self._first_at is None else self._first_at
        sweeps = {name: one.sweep for name, one in self.lasers.items() if one.sweep is not None}
        if self.estimator is None and len(sweeps) < len(self.lasers) and t - self._first_at < _GATHER_S:
            return False
        before = {name: sensor.sweep for name, sensor in self._sensors.items()}
        self._begin(before | sweeps)
        return True

    def _restart(self) -> list[Observation]:
        """An estimator that began anew knows nobody: say so."""
        again, self._anew = self._anew, False
        return [self.inventory()] if again else []

    def _begin(self, sweeps: Mapping[str, Sweep]) -> None:
        """A new estimator; what the one before knew is lost."""
        if self.estimator is not None:
            log.info("a laser is new or sweeps otherwise: the floor is learnt anew")
            self.labels.begin_anew()
            self._anew = True
        self._sensors = {name: self.lasers[name].sensor(sweep) for name, sweep in sweeps.items()}
        self.estimator = FloorEstimator(self._sensors, self.config.settings(), self.config.room_scene())

    def _restore(self, saved: Mapping[str, Any]) -> None:
        if "estimator" not in saved:
            return
        try:
            sweeps = {name: Sweep.from_json(one) for name, one in saved["sweeps"].items()}
            if set(sweeps) != set(self.lasers):
                raise ValueError("it is of other lasers")
            for name, pose in saved["poses"].items():
                if not np.allclose(pose, self.lasers[name].pose, atol=1e-6):
                    raise ValueError(f"laser {name} stands elsewhere now")
            sensors = {name: self.lasers[name].sensor(sweep) for name, sweep in sweeps.items()}
            estimator = FloorEstimator.from_dict(
                saved["estimator"], sensors, self.config.settings(), self.config.room_scene()
            )
            self.labels.restore(saved["labels"])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            log.warning("the saved state of the floor does not fit, starting anew: %s", error)
            return
        self._sensors, self.estimator = sensors, estimator
