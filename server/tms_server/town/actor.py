"""A room's actor: follows the log, folds it in fold order, keeps snapshots. Belief = fold(log), whatever the arrival.

What comes in order is folded at once. A record that belongs earlier winds the room back to the nearest state kept
before it and folds on from there, so the belief is, bit for bit, the one of in-order arrival.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Coroutine
from datetime import datetime, timedelta
from typing import Any, NamedTuple

from tms_server.clock import Clock
from tms_server.db.times import to_us
from tms_server.errors import Unavailable
from tms_server.log.blocks import Written
from tms_server.log.record import Position, Record
from tms_server.log.seam import RoomLog, Snapshot, Snapshots
from tms_server.settings import Settings
from tms_server.town.checkpoints import Checkpoints
from tms_server.town.fold import RoomFold
from tms_server.town.holdback import HoldBack

_log = logging.getLogger(__name__)
#: Seconds that a query waits for the fold to catch up before it is told to come back.
_PATIENCE_S = 30.0
_LAST_SEQ = 2**63 - 1


class Frozen(NamedTuple):
    """A state that nobody changes any more, the offset up to which it knows the log, and marginals found so far."""

    fold: RoomFold
    cursor: int
    marginals: dict[str, dict[str, float]]


class RoomActor:
    """One room. ``run`` never returns by itself, survives failures of the database, and cancelled ends a page first."""

    def __init__(self, room: str, log: RoomLog, snapshots: Snapshots, settings: Settings, clock: Clock) -> None:
        self.room = room
        #: Newest offset taken in: folded, or held back.
        self.head = 0
        self._log, self._snapshots, self._settings, self._clock = log, snapshots, settings, clock
        self._budget = None if settings.filter == "exact" else settings.budget
        self._fold = RoomFold(self._budget)
        self._past = Checkpoints(self._fold)
        #: Taken in but not folded.
        self._held = HoldBack()
        self._folding = asyncio.Lock()
        self._news = asyncio.Event()
        self._since_snapshot = 0
        self._frozen: Frozen | None = None

    async def run(self) -> None:
        pause_s = 0.5
        while True:
            try:
                await self._start()
                async for page in self._pages():
                    await _to_the_end(self._take(page))
                    pause_s = 0.5
            except Exception:
                _log.exception("the actor of room %s failed; it starts again in %g s", self.room, pause_s)
                self._since_snapshot = 0  # a page may be folded in part: nothing to store
                await asyncio.sleep(pause_s)
                pause_s = min(2 * pause_s, 30.0)

    async def reach(self, head: int) -> None:
        """Wait until the record at offset ``head`` was taken in. Raises ``Unavailable`` where that takes too long."""
        try:
            async with asyncio.timeout(_PATIENCE_S):
                while self.head < head:
                    await self._news.wait()
        except TimeoutError:
            raise Unavailable(f"the belief of room {self.room} is behind its log", retry_after_s=5) from None

    async def changes(self) -> AsyncIterator[int]:
        """``head`` now and after every change; what changes while the reader is busy comes as one."""
        while True:
            news = self._news
            yield self.head
            await news.wait()

    async def now(self) -> Frozen:
        """The newest state."""
        async with self._folding:
            if self._frozen is None:
                self._frozen = Frozen(self._fold.copy(), self.head, {})
            return self._frozen

    async def past(self, at: datetime | None, head: int) -> RoomFold:
        """The state at ``at`` (None: at the end) as the records up to offset ``head`` tell it."""
        until = None if at is None else Position(to_us(at), "\U0010ffff", _LAST_SEQ)
        fold = None
        if until is not None and head >= self.head:
            async with self._folding:
                kept = self._past.before(until)
                fold = kept.copy() if kept is not None else None
                head = self.head
        return await self._replayed(fold or await self._stored(head, before=until), until, head)

    async def close(self) -> None:
        """Store what was folded since the last snapshot. The actor must not run any more."""
        if self._since_snapshot:
            await self._save()

    # -- folding

    async def _start(self) -> None:
        """The newest stored state that still holds, then the rest of the log."""
        head = await self._log.head(self.room) or 0
        async with self._folding:
            fold = await self._stored(head, before=None)
            past = Checkpoints(fold)
            since_snapshot = 0
            horizon = self._horizon()
            held: list[Record] = []
            async for page in self._log.replay(self.room, after=fold.position, until=None, head=head):
                due = [record for record in page if record.observed_at <= horizon]
                held += page[len(due) :]
                await asyncio.to_thread(_fold_all, fold, past, due)
                since_snapshot += len(due)
            self._fold, self._past, self._held, self.head = fold, past, HoldBack(held), head
            self._since_snapshot = since_snapshot
            self._publish()

    async def _pages(self) -> AsyncIterator[list[Written]]:
        """New blocks as they come; an empty page where held ones fell due meanwhile."""
        if not self._settings.holdback_s:
            async for page in self._log.follow(self.room, self.head):
                yield page
            return
        pages = self._log.follow(self.room, self.head)
        following = asyncio.ensure_future(anext(pages))
        try:
            while True:
                done, _ = await asyncio.wait([following], timeout=self._settings.holdback_s / 4)
                yield following.result() if done else []
                if done:
                    following = asyncio.ensure_future(anext(pages))
        finally:
            following.cancel()

    async def _take(self, page: list[Written]) -> None:
        self._held.add(page)
        due = self._held.due(self._horizon())
        head = page[-1].block.offset if page else self.head
        if not due and head == self.head:
            return
        async with self._folding:
            if due:
                await self._fold_in(due, head)
            self.head = head
            self._publish()
        self._since_snapshot += len(due)
        if self._since_snapshot >= self._settings.snapshot_every:
            await self._save()

    async def _fold_in(self, due: list[Record], head: int) -> None:
        """Fold new records (in fold order) wherever they belong. In a thread: the event loop stays responsive."""
        first = due[0].position
        if first > self._fold.position:
            await asyncio.to_thread(_fold_all, self._fold, self._past, due)
            return
        rewound = self._past.rewind(first)
        if rewound is not None:
            self._fold, again = rewound
            merged = sorted([*again, *due], key=lambda record: record.position)
            await asyncio.to_thread(_fold_all, self._fold, self._past, merged)
            return
        # Before everything in memory: from a stored state, or from the beginning. The log holds the new records too.
        last = max(due[-1].position, self._fold.position)
        fold = await self._stored(head, before=first)
        past = Checkpoints(fold)
        async for page in self._log.replay(self.room, after=fold.position, until=last, head=head):
            await asyncio.to_thread(_fold_all, fold, past, page)
        self._fold, self._past = fold, past

    def _publish(self) -> None:
        self._frozen = None
        news, self._news = self._news, asyncio.Event()
        news.set()

    def _horizon(self) -> float:
        """Observations after it are held back, microseconds UTC."""
        held_back = self._settings.holdback_s
        return to_us(self._clock.now() - timedelta(seconds=held_back)) if held_back else float("inf")

    # -- the past

    async def _replayed(self, fold: RoomFold, until: Position | None, head: int) -> RoomFold:
        async for page in self._log.replay(self.room, after=fold.position, until=until, head=head):
            await asyncio.to_thread(_apply_all, fold, page)
        return fold

    async def _stored(self, head: int, *, before: Position | None) -> RoomFold:
        """The newest stored state that is whole and holds; the empty room where there is none."""
        async for snapshot in self._snapshots.load(self.room, head=head, before=before):
            try:
                fold = await asyncio.to_thread(RoomFold.from_bytes, snapshot.body)
            except ValueError as error:
                _log.warning("snapshot %d of room %s is left out: %s", snapshot.offset, self.room, error)
                continue
            if fold.engine.budget == self._budget and fold.position == snapshot.position:
                return fold
        return RoomFold(self._budget)

    async def _save(self) -> None:
        fold, cursor, _ = await self.now()
        try:
            body = await asyncio.to_thread(fold.to_bytes)
            await self._snapshots.save(Snapshot(self.room, cursor, fold.position, body))
        except Exception as error:
            # It only saves time at the next start, and the next one may succeed.
            _log.warning("no snapshot of room %s: %s", self.room, error)
        self._since_snapshot = 0


async def _to_the_end(step: Coroutine[Any, Any, None]) -> None:
    """Await ``step``, and where that is cancelled still all of it.

    A thread folds on whoever is cancelled, and a transaction that is let go half done may keep the write lock.
    """
    running = asyncio.ensure_future(step)
    try:
        await asyncio.shield(running)
    except asyncio.CancelledError:
        await asyncio.gather(running, return_exceptions=True)
        raise


def _fold_all(fold: RoomFold, past: Checkpoints, records: list[Record]) -> None:
    for record in records:
        fold.apply(record)
        past.folded(record, fold)


def _apply_all(fold: RoomFold, records: list[Record]) -> None:
    for record in records:
        fold.apply(record)
