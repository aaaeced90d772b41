"""Floor sensing: who walks and what lies in a room, from lasers that sweep just above the floor."""

import tms_agents.compiled  # noqa: F401, before there are kernels
from tms_agents.floor.estimator import FloorEstimator
from tms_agents.floor.events import Appeared, Back, Confused, FloorEvent, FloorLabel, Met, Moved, Stale, Vanished
from tms_agents.floor.settings import FloorSettings, Scene, Sensor

__all__ = [
    "Appeared",
    "Back",
    "Confused",
    "FloorEstimator",
    "FloorEvent",
    "FloorLabel",
    "FloorSettings",
    "Met",
    "Moved",
    "Scene",
    "Sensor",
    "Stale",
    "Vanished",
]
