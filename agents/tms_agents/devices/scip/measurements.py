"""Measurements out of replies, and captures of a sensor's output."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.scip.encoding import decode
from tms_agents.devices.scip.frames import Reply, ReplyParser
from tms_agents.devices.scip.requests import Measure, OldMeasure

#: The time stamp counts milliseconds in 24 bits: 4 h 39 min 37 s.
STAMP_TURN_MS = 1 << 24


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """``distances`` (n,) as sent: mm, and below the least distance of the model its error codes.

    ``intensities`` (n,) or None; ``stamp_ms`` the sensor's clock at its step 0, None in SCIP 1.1.
    """

    request: Measure | OldMeasure
    stamp_ms: int | None
    distances: NDArray[np.int32]
    intensities: NDArray[np.int32] | None = None


def measurement(reply: Reply) -> Measurement | None:
    """The measurement in a reply of the parser; None where it has none."""
    if len(reply.status) == 1:
        return _old(reply)
    request = Measure.parse(reply.command)
    if request is None or len(reply.lines) != 2:
        return None
    stamp, data = (np.frombuffer(line, np.uint8) for line in reply.lines)
    values = decode(data, request.width)
    distances, intensities = (values[::2], values[1::2]) if request.code[1] == "E" else (values, None)
    try:
        return Measurement(request, int(decode(stamp, 4)[0]), distances, intensities)
    except ValueError:  # the parser has seen its sum, not its characters
        return None


def read_capture(data: bytes) -> list[Measurement]:
    """All whole measurements in what a sensor sent; whatever else is in between is passed over."""
    found = [measurement(reply) for reply in ReplyParser().feed(data + b"\n\n")]
    return [one for one in found if one is not None]


def _old(reply: Reply) -> Measurement | None:
    request = OldMeasure.parse(reply.command)
    if request is None or len(reply.lines) != 1:
        return None
    try:
        return Measurement(request, None, decode(np.frombuffer(reply.lines[0], np.uint8), 2))
    except ValueError:
        return None
