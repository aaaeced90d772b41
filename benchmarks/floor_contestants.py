"""Who takes part in the benchmark of floor sensing: scans in, labels as a prediction has them out."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from floor_laboratory import LaboratoryFloor
from numpy.typing import NDArray

from tms_agents.devices.scans import Sweep
from tms_agents.floor import FloorEstimator, Scene, Sensor
from tms_agents.simulation.floor_world import Known

Floats = NDArray[np.float64]
Pose = tuple[float, float, float]


class Contestant(Protocol):
    def scan(self, sensor: str, t: float, ranges: Floats, intensities: Floats | None = None) -> int:
        """How many events that was."""

    def labels(self) -> list[dict[str, Any]]: ...


class Ours:
    """The estimator as an installer would set it up: poses as reported, the plan of the room."""

    def __init__(self, sensors: dict[str, tuple[Sweep, Pose]], known: Known | None = None) -> None:
        scene = Scene()
        if known is not None:
            scene = Scene(
                region=known.region,
                gates=known.gates,
                seats=known.seats,
                mirrors=known.mirrors,
                robots=known.robots,
            )
        mounted = {name: Sensor(sweep, pose) for name, (sweep, pose) in sensors.items()}
        self.estimator = FloorEstimator(mounted, scene=scene)

    def scan(self, sensor: str, t: float, ranges: Floats, intensities: Floats | None = None) -> int:
        return len(self.estimator.scan(sensor, t, ranges, intensities))

    def labels(self) -> list[dict[str, Any]]:
        return [{"id": one.id, "attr": one.kind, "x": one.xy[0], "y": one.xy[1]} for one in self.estimator.labels()]


class Laboratory:
    """The published algorithm, one for each laser; it knows nothing of the room."""

    def __init__(self, sensors: dict[str, tuple[Sweep, Pose]], known: Known | None = None) -> None:
        self._floors = {name: LaboratoryFloor(sweep.angles, pose) for name, (sweep, pose) in sensors.items()}

    def scan(self, sensor: str, t: float, ranges: Floats, intensities: Floats | None = None) -> int:
        floor = self._floors[sensor]
        before = {one["id"] for one in floor.labels()}
        floor.scan(t, ranges)
        return len(before ^ {one["id"] for one in floor.labels()})

    def labels(self) -> list[dict[str, Any]]:
        return [one | {"id": f"{name}{one['id']}"} for name, floor in self._floors.items() for one in floor.labels()]


CONTESTANTS: dict[str, type[Ours] | type[Laboratory]] = {"ours": Ours, "laboratory": Laboratory}
