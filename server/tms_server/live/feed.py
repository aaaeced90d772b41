"""One watched room: its newest version, and its newest log records as frames, shared by all viewers."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import NamedTuple

from tms_server.errors import TmsError, Unavailable
from tms_server.live.frames import event_frame
from tms_server.live.version import Encoder, Version
from tms_server.town import Town

_log = logging.getLogger(__name__)
#: Seconds between two versions: the longer they take to make, the fewer, so that at most ``_SHARE`` of the time goes
#: into them. After ``REFRESH_S`` the room is looked at again without news: silence shows.
MIN_INTERVAL_S, MAX_INTERVAL_S, REFRESH_S = 0.05, 1.0, 5.0
_SHARE = 0.2
#: Log records kept as frames, and read at once.
_KEPT, _PAGE = 4096, 500


class Event(NamedTuple):
    offset: int
    kind: str
    frame: str


class Feed:
    """``version`` is the newest state; ``run`` keeps it so."""

    def __init__(self, town: Town, room: str) -> None:
        self.room = room
        self.encoder = Encoder()
        self.viewers = 0
        self._town = town
        self._version: Version | None = None
        self._failed: TmsError | None = None
        self._news = asyncio.Event()
        self._recent: deque[Event] = deque(maxlen=_KEPT)
        self._reading = asyncio.Lock()

    async def run(self) -> None:
        """Follow the room until cancelled. What fails is told to the viewers, who come again."""
        try:
            async with self._town.subscribe(self.room) as changes:
                await self._follow(changes)
        except TmsError as error:
            self._failed = error
        except Exception:
            _log.exception("the live view of room %s failed", self.room)
            self._failed = Unavailable("the live view failed; come again", retry_after_s=1)
        self._tell()

    async def newer(self, than: Version | None) -> Version:
        """The newest version, as soon as there is another one than the viewer has. Raises ``TmsError``."""
        while True:
            if self._failed is not None:
                raise self._failed
            if self._version is not None and self._version is not than:
                return self._version
            await self._news.wait()

    async def events(self, after: int, until: int) -> list[Event]:
        """The next records with ``after < offset <= until``, at most a page; empty only where there are none."""
        async with self._reading:
            last = self._recent[-1].offset if self._recent else -1
            if last < until - _KEPT or last < after:  # nobody asked for some time: begin anew
                self._recent.clear()
                last = max(after, until - _KEPT)
            while last < until and (page := await self._read(last)):
                self._recent.extend(page)
                last = page[-1].offset
        if self._recent and self._recent[0].offset <= after + 1:
            first = after + 1 - self._recent[0].offset  # offsets are without gaps
            found = [self._recent[i] for i in range(first, min(len(self._recent), first + _PAGE))]
        else:
            found = await self._read(after)
        return [event for event in found if event.offset <= until]

    async def _follow(self, changes: AsyncIterator[int]) -> None:
        loop = asyncio.get_running_loop()
        change = asyncio.ensure_future(anext(changes))
        try:
            while True:
                done, _ = await asyncio.wait([change], timeout=REFRESH_S)
                if done:
                    change.result()
                    change = asyncio.ensure_future(anext(changes))
                view = await self._town.belief(self.room)
                began = loop.time()  # waiting for the belief costs nothing, making the version does
                version = Version.of(view, self._version)
                spent = loop.time() - began
                if version is not self._version:
                    self._version = version
                    self._tell()
                await asyncio.sleep(min(MAX_INTERVAL_S, max(MIN_INTERVAL_S, spent / _SHARE)))
        finally:
            change.cancel()

    async def _read(self, after: int) -> list[Event]:
        records = await self._town.records(self.room, after, _PAGE)
        return [Event(record.offset, record.kind, event_frame(record)) for record in records]

    def _tell(self) -> None:
        news, self._news = self._news, asyncio.Event()
        news.set()


class Feeds:
    """The feeds of all rooms that somebody watches, at most ``max_viewers`` in all."""

    def __init__(self, town: Town, *, max_viewers: int = 500) -> None:
        self._town = town
        self._max_viewers = max_viewers
        self._feeds: dict[str, Feed] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}

    @asynccontextmanager
    async def watch(self, room: str) -> AsyncIterator[Feed]:
        """The feed of a room, which runs while anybody watches. Raises ``Unavailable`` where there are too many."""
        if sum(feed.viewers for feed in self._feeds.values()) >= self._max_viewers:
            raise Unavailable(f"{self._max_viewers} viewers are connected already", retry_after_s=10)
        if room not in self._tasks or self._tasks[room].done():
            self._feeds[room] = Feed(self._town, room)
            self._tasks[room] = asyncio.create_task(self._feeds[room].run())
        feed, task = self._feeds[room], self._tasks[room]
        feed.viewers += 1
        try:
            yield feed
        finally:
            feed.viewers -= 1
            if feed.viewers == 0:
                task.cancel()
                if self._feeds.get(room) is feed:
                    del self._feeds[room], self._tasks[room]
