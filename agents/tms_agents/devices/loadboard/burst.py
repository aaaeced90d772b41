"""The board asked for all cells at once: fewer turns of the event loop, for firmware that queues what it is asked.

Answers come in the order of the questions, so a round counts only where exactly as many whole lines came as were asked
for, and nothing else until the next round. Anything else spoils the round, and nothing is asked until the line was
quiet for a pause; it is long, since an answer that comes later than that would be given to another cell. Which cell is
missing cannot be told: a board that does so again and again is a fault.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable

from tms_agents.devices.beat import next_moment
from tms_agents.devices.lines import LineParser
from tms_agents.devices.loadboard.session import INDEX, LONGEST_LINE, USUAL_ANSWER, answer_in, number_in
from tms_agents.devices.loads import LoadSample
from tms_agents.devices.outgoing import Outgoing
from tms_agents.devices.transport import DeviceFault

#: Spoiled rounds in a row after which the board is called faulty.
_MOST_SPOILED = 10
#: Where readings are waited for, the line is looked at so often, and quiet after this share of it.
_LOOK_S, _QUIET = 0.004, 0.7


class RosTmsBoardBurst(Outgoing):
    """Delivers a ``LoadSample`` of counts per round, one on every beat of ``period_s`` seconds (``devices.beat``), one
    round late; while it is to be ``prompt``, as soon as the line is quiet behind the answers.

    ``reply_s``: answers later than this spoil the round; ``quiet_s``: pause after a spoiled one.

    Raises:
        ValueError: more cells than there are indices, or none.
    """

    polled = True
    prompt = False

    def __init__(
        self,
        *,
        cells: int = 4,
        period_s: float = 0.02,
        reply_s: float = 0.06,
        quiet_s: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if not 1 <= cells <= len(INDEX):
            raise ValueError(f"a board has 1 to {len(INDEX)} cells, not {cells}")
        super().__init__()
        self.frames, self.ready = 0, False
        self._period_s, self._cells, self._reply_s, self._quiet_s, self._clock = (
            period_s,
            cells,
            reply_s,
            quiet_s,
            clock,
        )
        self._lines = LineParser(LONGEST_LINE)
        self._usual = re.compile(USUAL_ANSWER * cells)
        self._numbers: list[float] = []
        self._asked_at: float | None = None
        self._quiet_since: float | None = clock()  # what a former host asked for is thrown away first
        #: A round that may still be spoiled by what comes, and since when it is there; rounds to be given out.
        self._complete: LoadSample | None = None
        self._complete_at = 0.0
        self._done: list[LoadSample] = []
        self._next_round = 0.0
        self._spoiled = 0

    def opened(self) -> None:
        self._quiet_since = self._clock()

    def receive(self, data: bytes) -> list[LoadSample]:
        waiting = self._asked_at is not None and self._quiet_since is None
        if waiting and self._lines.between and not self._numbers and (answers := self._usual.fullmatch(data)):
            return self._whole(tuple(map(float, answers.groups())))
        lines = self._lines.feed(data)
        if self._quiet_since is not None:
            self._quiet_since = self._clock()
            return []
        numbers = [number_in(answer) for line in lines if (answer := answer_in(line))]
        self._numbers += [number for number in numbers if number is not None]
        if None in numbers or len(self._numbers) > (self._cells if self._asked_at is not None else 0):
            self._spoil()
            return []
        if len(self._numbers) == self._cells and not self._lines.pending:
            return self._whole(tuple(self._numbers))
        self._hand_out()
        return self.finished()

    def _whole(self, values: tuple[float, ...]) -> list[LoadSample]:
        """A round; what is handed out is the one before it, beside which nothing has come meanwhile."""
        self._hand_out()
        self._complete, self._complete_at = LoadSample(values=values), self._clock()
        self._numbers, self._asked_at, self._spoiled = [], None, 0
        self.frames += self._cells
        self.ready = True
        return self.finished()

    def _hand_out(self) -> None:
        if self._complete is not None:
            self._done.append(self._complete)
            self._complete = None

    def finished(self) -> list[LoadSample]:
        done, self._done = self._done, []
        return done

    @property
    def tick_s(self) -> float:
        now = self._clock()
        wait_s = next_moment(now, self._period_s) - now
        under_way = self._asked_at is not None or self._complete is not None
        return min(wait_s, _LOOK_S) if self.prompt and under_way else wait_s

    def tick(self) -> None:
        now = self._clock()
        if self._quiet_since is not None:
            if now - self._quiet_since < self._quiet_s:
                return
            self._lines.expire()
            self._quiet_since = None
        if self.prompt and now - self._complete_at > _QUIET * _LOOK_S:
            self._hand_out()
        if self._asked_at is not None:
            if now - self._asked_at > self._reply_s:
                self._spoil()
        elif (following := next_moment(now, self._period_s)) != self._next_round:
            self._asked_at, self._next_round = now, following
            self._output += INDEX[: self._cells].encode()

    @property
    def pending(self) -> int:
        """Bytes of an incomplete line."""
        return self._lines.pending

    def _spoil(self) -> None:
        answered = len(self._numbers)
        self._numbers, self._asked_at, self._complete, self._next_round = [], None, None, 0.0
        self._quiet_since = self._clock()
        # Silence is for the link to judge.
        self._spoiled += bool(answered)
        if self._spoiled >= _MOST_SPOILED:
            raise DeviceFault(
                f"{answered} answers to {self._cells} questions, {self._spoiled} times in a row;"
                ' ask = "one" tells which cell is missing'
            )
