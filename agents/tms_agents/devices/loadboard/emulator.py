"""The board for tests and demos: bytes in, bytes out; ``devices.emulation`` puts it behind a terminal or a port.

What the cells measure is a function of time, noise included: whether the antenna is on and disturbs the converter is
for the simulation behind it to decide.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Literal

from tms_agents.devices.loadboard.session import INDEX

Firmware = Literal["plain", "quoted", "ok", "ok-line"]
_FORMATS: dict[Firmware, str] = {"plain": "{}\r\n", "quoted": '"{}"\r\n', "ok": '"{}"OK\r\n', "ok-line": "OK\r\n{}\r\n"}


class RosTmsBoardDevice:
    """``counts(t)`` gives the value of every cell at time ``t`` of ``clock``, rounded to integers here.

    Faults, each until it is taken back: ``silent`` (does not hear either), ``deaf`` cells that are never answered,
    ``stuck`` cells with the value they repeat, ``delay_s`` for answers (needs a line with ``tick_s``). ``cut_next``
    answers lose their second half, ``garble_next`` are replaced by other bytes; ``power_cycle`` drops what is under way
    and is silent for ``boot_s``.
    """

    def __init__(
        self,
        counts: Callable[[float], Sequence[float]],
        *,
        firmware: Firmware = "plain",
        boot_s: float = 0.2,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.firmware: Firmware = firmware
        self.silent = False
        self.deaf: set[int] = set()
        self.stuck: dict[int, int] = {}
        self.delay_s = 0.0
        self.cut_next = self.garble_next = 0
        #: Characters received, for tests; the last thousand.
        self.heard: deque[str] = deque(maxlen=1000)
        self._counts, self._boot_s, self._clock = counts, boot_s, clock
        self._booted_at = clock()
        self._waiting: deque[tuple[float, bytes]] = deque(maxlen=1000)

    def power_cycle(self) -> None:
        self._waiting.clear()
        self._booted_at = self._clock() + self._boot_s

    def receive(self, data: bytes) -> bytes:
        now = self._clock()
        if self.silent or now < self._booted_at:
            return b""
        answers = b""
        for character in data.decode("latin-1"):
            self.heard.append(character)
            answers += self._answer(INDEX.find(character), now)
        if self.delay_s and answers:
            self._waiting.append((now + self.delay_s, answers))
            return b""
        return answers

    def tick(self) -> bytes:
        due = b""
        while self._waiting and self._waiting[0][0] <= self._clock():
            due += self._waiting.popleft()[1]
        return due

    def _answer(self, cell: int, now: float) -> bytes:
        counts = self._counts(now)
        if not 0 <= cell < len(counts) or cell in self.deaf:
            return b""
        answer = _FORMATS[self.firmware].format(self.stuck.get(cell, round(counts[cell]))).encode()
        if self.garble_next:
            self.garble_next -= 1
            return b"\xf3\x00?" + answer[:2][::-1] + b"\r\n"
        if self.cut_next:
            self.cut_next -= 1
            return answer[: len(answer) // 2]
        return answer
