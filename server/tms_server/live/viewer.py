"""One viewer: snapshot first, then events in order and states as fast as it takes them."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from tms_schemas.belief import ObjectPlacement
from tms_schemas.live import Subscribe
from tms_server.errors import Unavailable
from tms_server.live.feed import Feed
from tms_server.live.version import Version, state

#: A viewer that does not take one frame within this time is cut.
SEND_S = 10.0


class TooSlow(Unavailable):
    """The viewer's connection does not drain."""


class Viewer:
    """``send`` puts one text on the wire and waits while the connection is full."""

    def __init__(
        self, feed: Feed, wanted: Subscribe, send: Callable[[str], Awaitable[None]], *, send_s: float = SEND_S
    ) -> None:
        self._feed = feed
        self._wanted = wanted
        self._tags = frozenset(wanted.objects)
        self._kinds = frozenset(wanted.events)
        self._send = send
        self._send_s = send_s
        #: What the viewer was told last of each object, where it asked for larger changes only.
        self._told: dict[str, ObjectPlacement] = {}

    async def run(self) -> None:
        """Until cancelled. Raises ``TooSlow``, or what the feed raises."""
        version = await self._feed.newer(None)
        cursor = self._wanted.cursor
        if self._wanted.with_events and cursor is not None and cursor <= version.cursor:
            # The events that were missed, then the state anew: what went meanwhile is gone from a snapshot.
            await self._tell_events(cursor, version.cursor)
        await self._tell(self._feed.encoder.snapshot(version, self._tags))
        self._told = dict(version.objects) if self._wanted.min_change else {}
        while True:
            new = await self._feed.newer(version)
            if self._wanted.with_events:
                await self._tell_events(version.cursor, new.cursor)
            # After the events up to the same cursor: whoever resumes from it has missed nothing.
            frame = self._step(new, version)
            if frame is not None:
                await self._tell(frame)
            version = new

    async def _tell_events(self, after: int, until: int) -> None:
        while after < until:
            page = await self._feed.events(after, until)
            if not page:
                return
            for event in page:
                if not self._kinds or event.kind in self._kinds:
                    await self._tell(event.frame)
            after = page[-1].offset

    def _step(self, new: Version, old: Version) -> str | None:
        if not self._wanted.min_change:
            return self._feed.encoder.state(new, old, self._tags)
        for tag in self._told.keys() - new.objects.keys():
            del self._told[tag]
        # Against what was told, not against the version before: small steps add up.
        moved = [
            one
            for one in new.objects.values()
            if (not self._tags or one.tag in self._tags)
            and _largest_change(one, self._told.get(one.tag)) >= self._wanted.min_change
        ]
        self._told.update((one.tag, one) for one in moved)
        return state(new, old, moved, self._tags)

    async def _tell(self, frame: str) -> None:
        try:
            async with asyncio.timeout(self._send_s):
                await self._send(frame)
        except TimeoutError:
            raise TooSlow(f"no frame could be sent for {self._send_s:g} s", retry_after_s=5) from None


def _largest_change(new: ObjectPlacement, old: ObjectPlacement | None) -> float:
    if old is None:
        return 1.0
    before = {slice.label: slice.p for slice in old.distribution}
    after = {slice.label: slice.p for slice in new.distribution}
    return max((abs(after.get(label, 0.0) - before.get(label, 0.0)) for label in before | after), default=0.0)
