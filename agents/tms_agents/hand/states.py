"""What the robot tells of itself: joint states, base pose and grippers, as lines of JSON.

{"t": 1760000000.25, "joints": {"shoulder": 0.2}, "base": [1.2, 3.4, 1.57], "gripper": {"left": {"closed": true}}}

Every field may be left out; what is left out is as before.
"""

from __future__ import annotations

import logging
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from tms_agents.devices.transport import DeviceFault

log = logging.getLogger(__name__)

_MAX_LINE_BYTES = 1 << 16
#: So many bad lines in a row are no robot that speaks this.
_MAX_BAD_IN_A_ROW = 50

Small = Annotated[float, Field(ge=-1e4, le=1e4)]


class _Message(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)


class GripperMessage(_Message):
    """One gripper: what it measures. ``position`` (m, robot frame) is for robots that know where their gripper is."""

    closed: bool | None = None
    opening_m: Annotated[float, Field(ge=-1, le=5)] | None = None
    effort: Annotated[float, Field(ge=-1e6, le=1e6)] | None = None
    position: tuple[Small, Small, Small] | None = None


class StateMessage(_Message):
    """One line. ``t``: Unix time (s); joints: radians or metres; ``base``: (x, y, theta) in the room.

    ``base_sd`` is the standard deviation of the base's position (m) and heading (rad).
    """

    t: Annotated[float, Field(ge=0, le=1e11)] | None = None
    joints: Annotated[dict[str, Small], Field(max_length=500)] = {}
    base: tuple[Small, Small, Annotated[float, Field(ge=-1e3, le=1e3)]] | None = None
    base_sd: tuple[Annotated[float, Field(ge=0, le=100)], Annotated[float, Field(ge=0, le=7)]] | None = None
    gripper: Annotated[dict[str, GripperMessage], Field(max_length=20)] = {}


class StateLines:
    """The session of a stream of such lines (see ``devices.transport.Session``): listens only."""

    def __init__(self) -> None:
        self.frames = 0
        self.ready = False
        #: Lines that could not be used.
        self.bad = 0
        self._bad_in_a_row = 0
        self._rest = b""
        self._skipping = False

    def opened(self) -> None:
        """The robot speaks."""

    def receive(self, data: bytes) -> list[StateMessage]:
        *lines, rest = (self._rest + data).split(b"\n")
        if self._skipping and lines:
            lines, self._skipping = lines[1:], False
        if len(rest) > _MAX_LINE_BYTES:
            rest, self._skipping = b"", True
            self._bad_line(f"a line longer than {_MAX_LINE_BYTES} bytes")
        self._rest = b"" if self._skipping else rest
        return [message for line in lines if line.strip() and (message := self._message(line)) is not None]

    def tick(self) -> None:
        """Nothing is polled."""

    def output(self) -> bytes:
        return b""

    def closing(self) -> bytes:
        return b""

    def _message(self, line: bytes) -> StateMessage | None:
        try:
            message = StateMessage.model_validate_json(line)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            self._bad_line(f"{'.'.join(map(str, first['loc'])) or 'line'}: {first['msg']}")
            return None
        self.frames += 1
        self.ready, self._bad_in_a_row = True, 0
        return message

    def _bad_line(self, why: str) -> None:
        self.bad += 1
        self._bad_in_a_row += 1
        if self.bad & (self.bad - 1) == 0:  # the 1st, 2nd, 4th, 8th: often enough to see, too rare to fill a disk
            log.warning("robot state: bad line (%d so far): %s", self.bad, why)
        if self._bad_in_a_row >= _MAX_BAD_IN_A_ROW:
            raise DeviceFault(f"{self._bad_in_a_row} bad lines in a row, the last: {why}")
