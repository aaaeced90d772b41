"""What things weigh, from the object database; the last copy is kept for when the server cannot be asked."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections.abc import AsyncGenerator
from pathlib import Path

from tms_agents.cabinet import KnownWeight
from tms_agents.cabinet.config import WeightsSection
from tms_agents.files import write_atomically
from tms_client import AsyncTown
from tms_client.errors import NotFound, TownError
from tms_schemas.objects import TownObject

log = logging.getLogger(__name__)
_MAX_OBJECTS = 20_000
_MAX_WANTED = 200


class Weights:
    """Refreshed every ``refresh_s``; ``want`` asks for a tag that is not among the room's objects."""

    def __init__(self, town: AsyncTown, room: str, section: WeightsSection, copy: Path) -> None:
        self._town, self._room, self._section, self._copy = town, room, section, copy
        #: Known weights by tag.
        self.known: dict[str, KnownWeight] = {}
        self._asked: set[str] = set()
        self._wanted: asyncio.Queue[str] = asyncio.Queue(_MAX_WANTED)

    def load_copy(self) -> dict[str, KnownWeight]:
        """Of the last run; empty where there is none or it is damaged."""
        try:
            saved = json.loads(self._copy.read_bytes())
            self.known = {str(tag): KnownWeight(float(mean), float(sd)) for tag, (mean, sd) in saved.items()}
        except FileNotFoundError:
            pass
        except (OSError, ValueError, TypeError, AttributeError) as error:
            log.warning("weights %s cannot be used: %s", self._copy, error)
        return dict(self.known)

    def want(self, tag: str) -> None:
        """A tag was seen: ask for its weight once, unless it is known."""
        if tag not in self.known and tag not in self._asked:
            self._asked.add(tag)
            with contextlib.suppress(asyncio.QueueFull):
                self._wanted.put_nowait(tag)

    async def changes(self) -> AsyncGenerator[dict[str, KnownWeight], None]:
        """Weights that are new or different, for ever."""
        while True:
            try:
                if changed := await self._refresh():
                    yield changed
            except TownError as error:
                log.info("weights: the server cannot be asked: %s", error)
            ends = asyncio.get_running_loop().time() + self._section.refresh_s
            while True:
                try:
                    async with asyncio.timeout_at(ends):
                        tag = await self._wanted.get()
                except TimeoutError:
                    break
                if changed := await self._ask(tag):
                    yield changed

    async def _refresh(self) -> dict[str, KnownWeight]:
        found: dict[str, KnownWeight] = {}
        async for one in self._town.objects.search(room=self._room):
            if (weight := self._weight(one)) is not None:
                found[one.tag] = weight
            if len(found) >= _MAX_OBJECTS:
                break
        self._asked.clear()
        return await self._take(found)

    async def _ask(self, tag: str) -> dict[str, KnownWeight]:
        try:
            weight = self._weight(await self._town.objects.get(tag))
        except NotFound:
            return {}
        except TownError:
            self._asked.discard(tag)
            return {}
        return {} if weight is None else await self._take({tag: weight})

    async def _take(self, found: dict[str, KnownWeight]) -> dict[str, KnownWeight]:
        changed = {tag: weight for tag, weight in found.items() if self.known.get(tag) != weight}
        if changed:
            self.known |= changed
            body = json.dumps({tag: (one.mean_g, one.sd_g) for tag, one in self.known.items()}).encode()
            try:
                await asyncio.to_thread(write_atomically, self._copy, body)
            except OSError as error:
                log.warning("weights %s: %s", self._copy, error)
        return changed

    def _weight(self, one: TownObject) -> KnownWeight | None:
        if not one.weight_g:
            return None
        sd = one.weight_sd_g or max(self._section.sd_g, self._section.sd_share * one.weight_g)
        return KnownWeight(one.weight_g, sd)


def weights_path(spool: Path) -> Path:
    return spool.with_name(spool.name + ".weights.json")
