"""Scales that print lines of text: SparkFun OpenScale, A&D, Mettler Toledo MT-SICS; several of them as one board."""

from tms_agents.devices.scales.dialects import DIALECTS, GRAMS, Dialect, DialectName, Mode, parse_line
from tms_agents.devices.scales.group import LoadGroup
from tms_agents.devices.scales.session import ScaleLineSession

__all__ = [
    "DIALECTS",
    "GRAMS",
    "Dialect",
    "DialectName",
    "LoadGroup",
    "Mode",
    "ScaleLineSession",
    "parse_line",
]
