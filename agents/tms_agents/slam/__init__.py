"""Laser mapping: a particle filter over maps that share tiles, and loop closing behind it. No I/O to any server."""

from tms_agents.slam.filter import ParticleFilter
from tms_agents.slam.logs import Log, LogError, read_log
from tms_agents.slam.mapping import Progress, Result, build_map
from tms_agents.slam.settings import Settings

__all__ = ["Log", "LogError", "ParticleFilter", "Progress", "Result", "Settings", "build_map", "read_log"]
