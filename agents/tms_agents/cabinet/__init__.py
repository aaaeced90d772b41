"""The smart cabinet: what was put where on a board with load cells under it and tag readers around it."""

from tms_agents.cabinet.estimator import CabinetEstimator
from tms_agents.cabinet.events import (
    Appeared,
    CabinetEvent,
    Identified,
    LoadChanged,
    Moved,
    Stay,
    Vanished,
    Weighed,
    ZoneRead,
)
from tms_agents.cabinet.geometry import Covariance, Geometry, KnownWeight, Zone
from tms_agents.cabinet.settings import EstimatorSettings

__all__ = [
    "Appeared",
    "CabinetEstimator",
    "CabinetEvent",
    "Covariance",
    "EstimatorSettings",
    "Geometry",
    "Identified",
    "KnownWeight",
    "LoadChanged",
    "Moved",
    "Stay",
    "Vanished",
    "Weighed",
    "Zone",
    "ZoneRead",
]
