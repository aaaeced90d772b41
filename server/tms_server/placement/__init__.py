"""The belief engine: where every tracked object probably is, given what the sensors reported.

Knows nothing of HTTP or SQL. ``Engine`` is exact without a budget and a resampled hypothesis filter with one;
``PaperFilter`` is the particle filter that the system's first paper describes.
"""

from tms_server.placement.engine import Engine
from tms_server.placement.paper import PaperFilter
from tms_server.placement.parameters import LIVE, PAPER, ParameterError, Parameters
from tms_server.placement.specs import (
    OUT,
    BeliefFilter,
    DrawKey,
    Info,
    InvalidEvent,
    LabelSpec,
    LabelState,
    ObjectSpec,
)
from tms_server.placement.warm import warm_up

__all__ = [
    "LIVE",
    "OUT",
    "PAPER",
    "BeliefFilter",
    "DrawKey",
    "Engine",
    "Info",
    "InvalidEvent",
    "LabelSpec",
    "LabelState",
    "ObjectSpec",
    "PaperFilter",
    "ParameterError",
    "Parameters",
    "warm_up",
]
