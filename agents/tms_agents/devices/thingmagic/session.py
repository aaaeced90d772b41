"""The host side of ThingMagic modules: start the firmware, set it up, read every antenna in turn."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Literal

from tms_agents.devices.polling import PollingReader
from tms_agents.devices.tags import Field, RoundEnd, TagItem, TagRead
from tms_agents.devices.thingmagic import messages as m
from tms_agents.devices.thingmagic.codec import Command, Reply, ReplyParser
from tms_agents.devices.transport import DeviceFault

#: So many boot loaders in a row, without a read between them, are a fault.
_MAX_RESTARTS = 3


class ThingMagicSession(PollingReader[tuple[Command, int], Reply]):
    """Every ``poll_s`` seconds a cycle over all ``antennas``: select, read for ``read_ms``, ``RoundEnd``.

    ``multiple`` collects tags in the reader's buffer and fetches them with count, RSSI and antenna. ``single`` reads
    one tag at a time, for a hand; then only a read that finds nothing is a round that ended. ``region`` is a key of
    ``messages.REGIONS``; ``power_dbm`` None leaves the reader's own. The module radiates only while it reads: ``pause``
    takes effect when the read under way is over.
    """

    def __init__(
        self,
        *,
        antennas: Sequence[int] = (1,),
        region: str = "JP",
        power_dbm: float | None = None,
        mode: Literal["multiple", "single"] = "multiple",
        read_ms: int = 200,
        poll_s: float = 0.5,
        reply_s: float = 1.0,
        field: Field | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(ReplyParser(), poll_s=poll_s, reply_s=reply_s, field=field, clock=clock)
        self._antennas, self._single = tuple(antennas), mode == "single"
        self._read = m.read_single(read_ms) if self._single else m.read_multiple(read_ms)
        self._read_s = read_ms / 1000
        # Booting refuses with "invalid command" where the firmware runs already.
        self._set_up = [m.boot(), Command(m.VERSION), m.set_region(region), m.set_protocol()]
        if power_dbm is not None:
            self._set_up.append(m.set_read_power(power_dbm))
        self._to_fetch = 0
        self._elsewhere = False
        self._restarts = 0
        self._start_over()

    def _take(self, reply: Reply) -> list[TagItem]:
        if self._current is None or reply.code != self._current[0].code:
            return []  # a late reply
        (command, antenna), self._current = self._current, None
        if reply.status == m.INVALID_COMMAND and reply.code != m.BOOT:
            self._restarted(reply)
            return []
        if command == self._read and reply.status == m.NO_TAGS:
            self._alive()
            return [RoundEnd(antenna)]
        if reply.code == m.GET_BUFFER and reply.status in (m.NO_TAGS, m.BUFFER_EMPTY):
            return []  # fewer tags than announced: the round is no statement
        if reply.status != m.OK and not (reply.code == m.BOOT and reply.status == m.INVALID_COMMAND):
            where = f" (antenna {antenna})" if antenna else ""
            raise DeviceFault(f"the reader refuses command {command.code:02X}{where}: {m.meaning(reply.status)}")
        if command == self._read:
            self._alive()
            return self._single_read(reply, antenna) if self._single else self._counted(reply, antenna)
        return self._fetched(reply, antenna) if reply.code == m.GET_BUFFER else []

    def _single_read(self, reply: Reply, antenna: int) -> list[TagItem]:
        tag = m.single_tag(reply)
        return [TagRead(tag=tag, antenna=antenna)] if tag else []

    def _counted(self, reply: Reply, antenna: int) -> list[TagItem]:
        count = m.tag_count(reply)
        if count is None:
            raise DeviceFault(f"the reader answers read multiple with {len(reply.data)} bytes")
        self._to_fetch, self._elsewhere = count, False
        if not count:
            return [RoundEnd(antenna)]
        self._waiting.appendleft((m.get_buffer(), antenna))
        return []

    def _fetched(self, reply: Reply, antenna: int) -> list[TagItem]:
        reads = m.buffered_tags(reply, antenna)
        if reads is None:
            raise DeviceFault("the reader's tag buffer cannot be understood")
        self._to_fetch -= len(reads)
        # A module that was restarted reads with another antenna than the one asked for.
        self._elsewhere = self._elsewhere or any(read.antenna != antenna for read in reads)
        if self._to_fetch > 0 and reads:
            self._waiting.appendleft((m.get_buffer(), antenna))
        complete = self._to_fetch == 0 and not self._elsewhere
        return [*reads, RoundEnd(antenna)] if complete else [*reads]

    def _restarted(self, reply: Reply) -> None:
        """The module has been switched off and on and waits in its boot loader."""
        self._restarts += 1
        if self._restarts > _MAX_RESTARTS:
            raise DeviceFault(f"the reader refuses command {reply.code:02X}: {m.meaning(reply.status)}")
        self._start_over()

    def _alive(self) -> None:
        self.ready, self._restarts = True, 0

    def _start_over(self) -> None:
        self._current = None
        self._waiting = deque((command, 0) for command in self._set_up)

    def _plan(self) -> None:
        if not self.field.wanted:
            self.field.is_off = True
            self._drop_reads()
            if self._is_due():  # still there?
                self._waiting.append((Command(m.VERSION), 0))
        elif self._is_due():
            for antenna in self._antennas:
                commands = [m.set_antenna(antenna), *([] if self._single else [m.clear_buffer()]), self._read]
                self._waiting += [(command, antenna) for command in commands]

    def _encode(self, command: tuple[Command, int]) -> bytes:
        return command[0].encode()

    def _patience_s(self) -> float:
        reads = self._current is not None and self._current[0] == self._read
        return self._reply_s + (self._read_s if reads else 0.0)

    def _drop_reads(self) -> None:
        # setting up and fetching what is read already do not radiate
        self._waiting = deque(one for one in self._waiting if one[0].code == m.GET_BUFFER or not one[1])
