"""The group-commit writer: batches that arrive while a transaction runs share the next one."""

from __future__ import annotations

import asyncio
import logging
from collections import Counter, deque
from collections.abc import Callable
from typing import NamedTuple

from tms_server.errors import TmsError, TooManyRequests, Unavailable
from tms_server.log.record import Appended, Batch
from tms_server.log.seam import RoomLog
from tms_server.settings import Settings

_log = logging.getLogger(__name__)
#: Observations of one transaction, at most (a batch is never split).
_GROUP = 5000
#: That the log cannot be written is said so often.
_SAY_S = 60.0


class _Waiting(NamedTuple):
    batch: Batch
    verdict: asyncio.Future[Appended]


class GroupWriter:
    """Refuses what it cannot hold, acknowledges only what is durable.

    ``backlog`` tells how many records of a room are durable but not yet folded.
    """

    def __init__(self, log: RoomLog, settings: Settings, backlog: Callable[[str], int]) -> None:
        self._log = log
        self._settings = settings
        self._backlog = backlog
        self._queue: deque[_Waiting] = deque()
        self._held: Counter[str] = Counter()
        self._total = 0
        self._wake = asyncio.Event()
        self._closing = False
        #: Batches refused since the log was written last, and when that was said.
        self._refused, self._said_at = 0, 0.0

    async def submit(self, batch: Batch) -> Appended:
        """Returns after durability.

        Raises:
            TooManyRequests: the agent has too many observations waiting.
            Unavailable: the queue of all agents or the room's fold is full, or the database failed.
            Conflict, NotFound: see ``RoomLog.append``.
        """
        self._admit(batch)
        waiting = _Waiting(batch, asyncio.get_running_loop().create_future())
        self._queue.append(waiting)
        self._hold(batch, +1)
        self._wake.set()
        return await waiting.verdict

    async def run(self) -> None:
        """Write until ``close`` was called and everything admitted is durable or refused."""
        while self._queue or not self._closing:
            if not self._queue:
                self._wake.clear()
                await self._wake.wait()
                continue
            if not self._closing:  # what is being read just now shares the transaction
                await asyncio.sleep(self._settings.linger_s)
            group = self._next_group()
            try:
                await self._write(group)
            finally:
                for waiting in group:
                    self._hold(waiting.batch, -1)

    def close(self) -> None:
        self._closing = True
        self._wake.set()

    async def _write(self, group: list[_Waiting]) -> None:
        try:
            verdicts = await self._log.append([waiting.batch for waiting in group])
        except Exception as error:
            # Whatever it was, the writer goes on: without it every agent would wait for ever.
            self._say_refused(len(group), error)
            known = error if isinstance(error, TmsError) else Unavailable("the log cannot be written", retry_after_s=5)
            # An exception of its own for each: a raised one grows a traceback per waiter.
            verdicts = [Unavailable(known.detail, retry_after_s=known.retry_after_s) for _ in group]
        else:
            if self._refused:
                _log.warning("the log is written again; %d batches were refused, and are sent again", self._refused)
            self._refused = 0
        for waiting, verdict in zip(group, verdicts, strict=True):
            if waiting.verdict.done():  # the client went away; what was recorded is a duplicate when it comes back
                continue
            if isinstance(verdict, Appended):
                waiting.verdict.set_result(verdict)
            else:
                waiting.verdict.set_exception(verdict)

    def _say_refused(self, batches: int, error: Exception) -> None:
        """Where it happened, the first time; then how often, now and then: agents try again all the time."""
        now = asyncio.get_running_loop().time()
        if not self._refused or now - self._said_at >= _SAY_S:
            seen = None if self._refused else error.__cause__ or error
            _log.error("%d batches refused: %s", self._refused + batches, error, exc_info=seen)
            self._said_at = now
        self._refused += batches

    def _admit(self, batch: Batch) -> None:
        count, limits = len(batch.observations), self._settings
        if self._closing:
            raise Unavailable("the server is shutting down", retry_after_s=5)
        if self._held[batch.agent] and self._held[batch.agent] + count > limits.queue_per_agent:
            raise TooManyRequests(
                f"agent {batch.agent} has {self._held[batch.agent]} observations waiting to be written", retry_after_s=1
            )
        if self._total and self._total + count > limits.queue_observations:
            raise Unavailable(f"{self._total} observations are waiting to be written", retry_after_s=2)
        if self._backlog(batch.room) > limits.fold_backlog:
            raise Unavailable(f"the belief of room {batch.room} is behind its log", retry_after_s=5)

    def _next_group(self) -> list[_Waiting]:
        group: list[_Waiting] = []
        room_left = _GROUP
        while self._queue and (not group or len(self._queue[0].batch.observations) <= room_left):
            group.append(self._queue.popleft())
            room_left -= len(group[-1].batch.observations)
        return group

    def _hold(self, batch: Batch, sign: int) -> None:
        self._total += sign * len(batch.observations)
        self._held[batch.agent] += sign * len(batch.observations)
        if not self._held[batch.agent]:
            del self._held[batch.agent]
