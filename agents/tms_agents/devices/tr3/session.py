"""The host side of TR3: poll every antenna in turn, or listen to a reader in RDLOOP mode."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

from tms_agents.devices.polling import PollingReader
from tms_agents.devices.tags import Field, RoundEnd, TagItem, TagRead
from tms_agents.devices.tr3.codec import (
    INVENTORY_OPTIONS,
    MODE,
    NACK,
    RDLOOP,
    SUM_ERROR,
    UID,
    Frame,
    FrameParser,
    acknowledges,
    command_mode,
    inventory,
    read_version,
    rf_power,
    select_antenna,
)
from tms_agents.devices.transport import DeviceFault

Mode = Literal["inventory", "rdloop"]
#: How often a command that arrived damaged is sent again.
_REPEATS = 2
#: Tags of one round: more than a reader can read in it.
_MOST_REMEMBERED = 1000


class _Command(NamedTuple):
    frame: Frame
    #: The antenna that an inventory is about.
    antenna: int | None = None
    #: A refusal of this one does no harm.
    optional: bool = False


class Tr3Session(PollingReader[_Command, Frame]):
    """``inventory``: every ``poll_s`` seconds a cycle over all antennas: select, ask for the tags, ``RoundEnd``.

    A TR3 does not report a UID again until the antenna is switched. Where a cycle begins at the antenna that is
    selected already (one antenna only, or a cycle broken off), another one is selected before. A reader without antenna
    switch gets its field switched off and on instead, and a round of it counts only once it has shown that it repeats.

    ``rf_off_between_rounds`` radiates only during cycles; ``rest_antenna`` is one with nothing connected, selected when
    the field is switched off. ``pause`` and ``resume`` do so on demand. ``rdloop``: send nothing and take the frames
    of a reader that was set to report by itself; it has no rounds.
    """

    def __init__(
        self,
        *,
        antennas: Sequence[int] = (0,),
        mode: Mode = "inventory",
        poll_s: float = 0.2,
        reply_s: float = 0.5,
        rf_off_between_rounds: bool = False,
        rest_antenna: int | None = None,
        field: Field | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(FrameParser(), poll_s=poll_s, reply_s=reply_s, field=field, clock=clock)
        self._antennas = tuple(antennas)
        self._rests, self._rest_antenna = rf_off_between_rounds, rest_antenna
        self._polls = mode == "inventory"
        self._repeats = 0
        self._tags_to_come: int | None = None
        self._set_up = False
        self._radiates: bool | None = None
        self._pausing = False
        self._selected: int | None = None
        self._switches = True
        self._option = INVENTORY_OPTIONS[0]
        self._options_left = list(INVENTORY_OPTIONS[1:])
        self._forgetful = _Forgetful()

    def closing(self) -> bytes:
        return rf_power(False).encode() if self._polls else b""

    def _take(self, frame: Frame) -> list[TagItem]:
        uid, current = frame.uid(), self._current
        if frame.command == RDLOOP and uid is not None and not self._polls:
            self.ready = True
            return [TagRead(tag=uid)]
        if current is None or frame.command == RDLOOP:
            return []
        if frame.command == UID and uid is not None:
            return self._tag(uid, current)
        if frame.command == NACK:
            self._refused(frame, current)
        elif acknowledges(frame, current.frame):
            return self._acknowledged(frame, current)
        return []

    def _tag(self, uid: str, current: _Command) -> list[TagItem]:
        # ISO 15693-3: the first byte of every UID is E0. A UID after anything but an inventory is a late one.
        if current.antenna is None or not uid.startswith("E0"):
            return []
        if not self._switches:
            self._forgetful.saw(uid)
        if self._tags_to_come is not None:
            self._tags_to_come -= 1
        return [TagRead(tag=uid, antenna=current.antenna), *self._round_end(current.antenna)]

    def _acknowledged(self, frame: Frame, current: _Command) -> list[TagItem]:
        if current.antenna is not None:
            self.ready = True
            self._tags_to_come = frame.data[1]
            return self._round_end(current.antenna)
        self._obeyed(current.frame)
        self._done()
        return []

    def _round_end(self, antenna: int) -> list[TagItem]:
        """The end of the round where all tags announced have come; nothing before."""
        if self._tags_to_come is None or self._tags_to_come > 0:
            return []
        self._done()
        return [RoundEnd(antenna)] if self._switches or self._forgetful.next_round() else []

    def _refused(self, frame: Frame, current: _Command) -> None:
        if frame.refusal_code == SUM_ERROR and self._repeats < _REPEATS:
            self._repeats += 1
            self._output += current.frame.encode()
        elif current.antenna is not None and self._options_left:
            self._option = self._options_left.pop(0)
            self._current = current._replace(frame=inventory(self._option))
            self._output += self._current.frame.encode()
        elif current.optional:
            if current.frame.data[:1] == b"\x9c":
                self._switches, self._selected = False, None
            elif current.frame.data[:1] == b"\x9e":
                self._radiates = True  # a field that cannot be switched is on
            elif current.frame.command == MODE:
                self._set_up = True
            self._done()
        else:
            raise DeviceFault(
                f"the reader refuses command {current.frame.encode().hex(' ').upper()}: {frame.refusal()}"
            )

    def _obeyed(self, command: Frame) -> None:
        if command.data[:1] == b"\x9e":
            self._radiates = bool(command.data[1])
            self.field.is_off = not self._radiates and not self.field.wanted
        elif command.data[:1] == b"\x9c":
            self._selected = command.data[1]
        elif command.command == MODE:
            self._set_up = True

    def _done(self) -> None:
        self._current, self._tags_to_come, self._repeats = None, None, 0

    def _start_over(self) -> None:
        """A reply is missing: the reader may have been switched off and on, so nothing about it is known."""
        self._waiting.clear()
        self._done()
        self.field.is_off = False
        self._set_up, self._radiates, self._selected, self._pausing = False, None, None, False

    def _plan(self) -> None:
        if not self._polls:
            return
        if not self.field.wanted:
            if not self._pausing:
                self._pausing = True
                self._waiting = deque() if self._radiates is False else deque(self._switched_off())
                self.field.is_off = self._radiates is False
            elif self._is_due():  # still there?
                self._waiting.append(_Command(read_version(), optional=True))
        else:
            self._pausing = False
            if self._is_due():
                self._waiting += self._cycle()

    def _encode(self, command: _Command) -> bytes:
        return command.frame.encode()

    def _cycle(self) -> list[_Command]:
        commands = [] if self._set_up else [_Command(command_mode(), optional=True)]
        if not self._switches:
            commands.append(_Command(rf_power(False), optional=True))
        if not self._radiates or not self._switches:
            commands.append(_Command(rf_power(True), optional=True))
        alone = len(self._antennas) == 1
        if self._switches and self._selected in (None, self._antennas[0]):
            other = self._antennas[0] + 1 if alone else self._antennas[1]
            commands.append(_Command(select_antenna(other), optional=alone))
        for antenna in self._antennas:
            if self._switches:
                commands.append(_Command(select_antenna(antenna), optional=alone))
            commands.append(_Command(inventory(self._option), antenna))
        return commands + (self._switched_off() if self._rests else [])

    def _switched_off(self) -> list[_Command]:
        rest = [] if self._rest_antenna is None else [_Command(select_antenna(self._rest_antenna))]
        return [_Command(rf_power(False)), *rest]


class _Forgetful:
    """Whether a reader without antenna switch repeats tags: only then does its silence about one mean anything."""

    def __init__(self) -> None:
        self._before: set[str] = set()
        self._now: set[str] = set()
        self._proved = False

    def saw(self, uid: str) -> None:
        if len(self._now) < _MOST_REMEMBERED:
            self._now.add(uid)

    def next_round(self) -> bool:
        self._proved = self._proved or bool(self._now & self._before)
        self._before, self._now = self._now, set()
        return self._proved
