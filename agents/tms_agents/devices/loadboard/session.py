"""The host side of the board: ask one cell after the other, and never take an answer for that of another cell.

An answer does not say which cell it is of, so one question is on the way at a time, and three things are doubtful:

* an answer that does not come in time may still come later: its cell is NaN, and nothing is asked until the line was
  quiet for a pause of ``late_s``; what comes in that time is thrown away;
* a line that is no number may have been an answer or come beside it: the same;
* a line that nobody asked for says that an earlier answer was shifted to the next cell: the whole round is dropped, and
  the pause, which was too short for this board, is doubled for a while.

So that the last of these is seen in time, a round is kept back until the line was quiet for twice the slowest of the
last answers, and, where nobody waits for it, until the next one is due. The numbers themselves carry no check sum: a
wrong digit is for the estimator to find.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable

from tms_agents.devices.beat import next_moment
from tms_agents.devices.lines import LineParser
from tms_agents.devices.loads import LoadSample
from tms_agents.devices.outgoing import Outgoing

#: Sensor index -> the character that asks for it.
INDEX = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"
_QUESTIONS = [character.encode() for character in INDEX]
_NUMBER = re.compile(rb"[+-]?\d{1,10}")
#: What nearly all answers look like.
USUAL_ANSWER = rb'"?([+-]?\d{1,10})"?(?:OK)?\r\n'
_USUAL = re.compile(USUAL_ANSWER)
_OLD_FIRMWARE = b'OK"'
#: Bytes of a line, at most.
LONGEST_LINE = 40
#: A cell that missed this many answers in a row is asked less often, so that it does not slow down the others.
_MISSES = 3
#: How fast the slowest answer is forgotten, per answer, and a doubled pause, per round; the longest pause.
_FORGET, _RELAX = 0.999, 0.998
_LONGEST_PAUSE_S = 2.0
#: Share of a period for which a line must be quiet after a round at least.
_LEAST_QUIET = 0.3


class RosTmsBoardSession(Outgoing):
    """Delivers a ``LoadSample`` of counts per round, one round on every beat of ``period_s`` seconds (``devices.beat``)
    if the board is fast enough.

    ``reply_s``: an answer later than this is missing. A cell that misses three in a row is NaN from then on and asked
    every ``retry_s``; ``fault`` names it. Only answers count as signs of life, so a board that gives none is silent for
    the link, and delivers nothing.

    Raises:
        ValueError: more cells than there are indices, or none.
    """

    def __init__(
        self,
        *,
        cells: int = 4,
        period_s: float = 0.02,
        reply_s: float = 0.05,
        late_s: float = 0.1,
        retry_s: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if not 1 <= cells <= len(INDEX):
            raise ValueError(f"a board has 1 to {len(INDEX)} cells, not {cells}")
        super().__init__()
        self.frames = 0
        self.ready = False
        self.prompt = False
        #: Rounds thrown away because an answer came that nobody had asked for.
        self.doubtful_rounds = 0
        self._period_s, self._reply_s, self._late_s, self._retry_s = period_s, reply_s, late_s, retry_s
        self._clock = clock
        self._lines = LineParser(LONGEST_LINE)
        self._values = [float("nan")] * cells
        self._misses = [0] * cells
        self._ask_again = [0.0] * cells
        self._round: list[int] = []  # cells still to ask
        self._asked: int | None = None
        self._asked_at = self._heard_at = self._next_round = clock()
        self._draining, self._open_round, self._overdue = True, False, False
        self._slowest_s, self._pause_s = 0.0, late_s
        self._done: list[LoadSample] = []

    def opened(self) -> None:
        """What a former host asked for is thrown away first."""
        self._heard_at = self._clock()

    def receive(self, data: bytes) -> list[LoadSample]:
        now = self._heard_at = self._clock()
        self._overdue = False
        for line in self._lines.feed(data):
            self._line(answer_in(line), now)
        return self.finished()

    def answered(self, data: bytes) -> bytes | None:
        asked = self._asked
        if asked is None or not self._lines.between or not (answer := _USUAL.fullmatch(data)):
            return None
        now = self._heard_at = self._clock()
        self._take(asked, float(answer[1]), now)
        if not self._round:
            self._asked = None
            return b""
        self._asked, self._asked_at = self._round.pop(0), now
        return _QUESTIONS[self._asked]

    def nothing_by(self, now: float) -> None:
        self._overdue = now >= self._due() and not self._idle

    def finished(self) -> list[LoadSample]:
        done, self._done = self._done, []
        return done

    @property
    def tick_s(self) -> float:
        """Seconds until something is due; not more than to the next round, so that its time need not be told again."""
        if self._overdue:
            return 0.0
        now, due = self._clock(), self._due()
        return (self._next_round if now < self._next_round < due else due) - now

    def tick(self) -> None:
        now = self._clock()
        if now < self._due():
            return
        # This process may have slept between its look at the line and now: quiet is what was so at a second look.
        self._overdue = not self._overdue and not self._idle
        if self._overdue:
            return
        if self._asked is not None:
            self._miss(now)
        elif self._draining:
            self._lines.expire()
            self._draining = False
            self._ask_next(now)
        elif self._open_round:
            self._finish()
        if self._idle and now >= self._next_round:
            self._start(now)

    @property
    def _idle(self) -> bool:
        return self._asked is None and not self._draining and not self._open_round

    def _due(self) -> float:
        """When the line has been quiet for long enough; while nothing is under way, when the next round begins."""
        if self._asked is not None:
            return self._asked_at + self._reply_s
        if self._draining:
            return self._heard_at + self._pause_s
        if self._open_round:
            quiet = self._heard_at + min(max(2 * self._slowest_s, _LEAST_QUIET * self._period_s), self._late_s)
            # When the next round begins: that is one wake-up for both.
            return quiet if self.prompt else max(quiet, self._next_round)
        return self._next_round

    @property
    def pending(self) -> int:
        """Bytes of an incomplete line."""
        return self._lines.pending

    def _start(self, now: float) -> None:
        self._next_round = next_moment(now, self._period_s)
        self._values = [float("nan")] * len(self._values)
        self._round = list(range(len(self._values)))
        if any(self._misses):
            self._round = [one for one in self._round if self._misses[one] < _MISSES or now >= self._ask_again[one]]
        self._open_round = bool(self._round)
        self._ask_next(now)

    def _ask_next(self, now: float) -> None:
        if self._round:
            self._asked, self._asked_at, self._overdue = self._round.pop(0), now, False
            self._output += _QUESTIONS[self._asked]

    def _line(self, line: bytes, now: float) -> None:
        if not line or self._draining:
            return
        if self._asked is None:
            self._drop()
        elif (number := number_in(line)) is None:
            self._miss(now)
        else:
            self._take(self._asked, number, now)
            self._asked = None
            self._ask_next(now)

    def _take(self, cell: int, number: float, now: float) -> None:
        self._values[cell] = number
        self._misses[cell] = 0
        self._slowest_s = max(self._slowest_s * _FORGET, now - self._asked_at)
        self.frames += 1
        self.ready = True

    def _miss(self, now: float) -> None:
        assert self._asked is not None
        self._misses[self._asked] += 1
        self._ask_again[self._asked] = now + self._retry_s
        self._asked, self._draining = None, True
        self._heard_at, self._overdue = now, False

    def _drop(self) -> None:
        self.doubtful_rounds += bool(self._open_round or self._done)
        self._pause_s = max(self._pause_s, min(2 * self._pause_s, _LONGEST_PAUSE_S))
        self._done.clear()
        self._round, self._open_round, self._draining = [], False, True

    def _finish(self) -> None:
        if self._lines.pending:  # the beginning of a line that nobody asked for
            self._drop()
            return
        self._open_round = False
        self._pause_s = max(self._pause_s * _RELAX, self._late_s)
        if not any(self._misses):
            self._done.append(LoadSample(values=tuple(self._values)))
            return
        dead = [str(cell) for cell, misses in enumerate(self._misses) if misses >= _MISSES]
        fault = f"no answer from cell {', '.join(dead)}" if dead else ""
        if not all(map(math.isnan, self._values)):
            self._done.append(LoadSample(values=tuple(self._values), fault=fault))


def answer_in(line: bytes) -> bytes:
    """A line without what older firmware says around its numbers; empty where that is all."""
    return line.translate(None, _OLD_FIRMWARE).strip()


def number_in(answer: bytes) -> float | None:
    """The counts; None where the answer is no number."""
    return float(answer) if _NUMBER.fullmatch(answer) else None
