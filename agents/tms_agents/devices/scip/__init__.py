"""Hokuyo laser range finders, SCIP 1.1 and 2: serial line, USB and TCP (port 10940); an emulator of six models."""

from tms_agents.devices.scip.emulator import ScipDevice
from tms_agents.devices.scip.frames import Reply, ReplyParser
from tms_agents.devices.scip.links import PORT, ScipLink, scip_serial
from tms_agents.devices.scip.measurements import Measurement, measurement, read_capture
from tms_agents.devices.scip.models import MODELS, Coding, Model, coding
from tms_agents.devices.scip.parameters import Parameters, sweep
from tms_agents.devices.scip.ranges import ranges
from tms_agents.devices.scip.requests import Measure
from tms_agents.devices.scip.session import ScipSession, ScipSettings

__all__ = [
    "MODELS",
    "PORT",
    "Coding",
    "Measure",
    "Measurement",
    "Model",
    "Parameters",
    "Reply",
    "ReplyParser",
    "ScipDevice",
    "ScipLink",
    "ScipSession",
    "ScipSettings",
    "coding",
    "measurement",
    "ranges",
    "read_capture",
    "scip_serial",
    "sweep",
]
