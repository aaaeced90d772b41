"""Laser mapping: a particle filter over maps that share tiles, and loop closing behind it; localisation in a known
map. No I/O to any server."""

import tms_agents.compiled  # noqa: F401, before there are kernels
from tms_agents.slam.filter import ParticleFilter
from tms_agents.slam.known import MapError, known_map
from tms_agents.slam.localisation import Localiser
from tms_agents.slam.localisation_settings import LocalisationSettings
from tms_agents.slam.log_files import read_log
from tms_agents.slam.logs import Log, LogError
from tms_agents.slam.mapping import Progress, Result, build_map
from tms_agents.slam.settings import Settings

__all__ = [
    "LocalisationSettings",
    "Localiser",
    "Log",
    "LogError",
    "MapError",
    "ParticleFilter",
    "Progress",
    "Result",
    "Settings",
    "build_map",
    "known_map",
    "read_log",
]
