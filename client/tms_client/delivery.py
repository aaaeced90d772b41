"""From the spool to the server: in order, in batches, nothing lost and nothing in the way.

A batch is accepted whole or not at all. Items the server names as bad go to the dead letters with its reason and the
rest is sent again; a refusal that names nothing is narrowed down by halving the batch.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from dataclasses import dataclass

from tms_client.api import Api
from tms_client.errors import BadRequest, Busy, Conflict, Invalid, Refused, TooLarge, TownError, Unreachable
from tms_client.flows import NO_RETRY, Flow, Retry, Wait
from tms_client.spool import Item, Spool
from tms_schemas.observation import MAX_BATCH
from tms_schemas.problem import ProblemItem

log = logging.getLogger(__name__)


@dataclass(kw_only=True)
class Pace:
    """How fast to post: at most ``batch`` observations at once, at the latest ``linger_s`` after the first of them.

    What comes after a pause is posted at once, what follows ``linger_s`` after it.
    """

    batch: int = 500
    linger_s: float = 0.1
    #: Pause after a refusal that waiting alone may not cure (key revoked, room deleted).
    refused_s: float = 30.0

    def __post_init__(self) -> None:
        if not 1 <= self.batch <= MAX_BATCH:
            raise ValueError(f"batch must be 1 to {MAX_BATCH}")


class Delivery:
    """Posting one spool, as flows: knows whether the numbering is agreed and how large a batch may be."""

    def __init__(self, spool: Spool, pace: Pace, retry: Retry) -> None:
        self.spool = spool
        #: Why the last try failed; None while posting works.
        self.trouble: TownError | None = None
        self._pace, self._retry = pace, retry
        self._limit = pace.batch
        self._agreed = self._conflict_told = False
        self._api = Api(NO_RETRY)

    def drain(self, go_on: Callable[[], bool]) -> Flow[bool]:
        """Send until nothing waits (True) or ``go_on`` says no (False). Failures are waited out, never raised."""
        failures = 0
        while go_on():
            try:
                idle = yield from self.round()
            except TownError as error:
                failures += 1
                self._note(error)
                yield Wait(self._pause(error, failures))
                continue
            failures = 0
            self._note(None)
            if idle:
                return True
        return False

    def round(self) -> Flow[bool]:
        """Send one batch; True where nothing was waiting."""
        if not self._agreed:
            yield from self._agree()
        items = self.spool.peek(self._limit)
        if not items:
            return True
        try:
            yield from self._api.post_numbered(
                self.spool.agent, items[0].room, [(item.seq, item.body) for item in items]
            )
        except (Invalid, Conflict, BadRequest, TooLarge) as refused:
            self._sort_out(items, refused)
            return False
        self.spool.acknowledge(items)
        self._limit = min(self._pace.batch, self._limit * 2)
        return False

    def _agree(self) -> Flow[None]:
        """Learn which numbers the server has seen, in case this spool is new or an old copy."""
        view = yield from self._api.agent(self.spool.agent)
        # Labels of a lost spool: beyond one per millisecond up to the agent's last sign of life.
        seen = 0.0 if view.last_seen is None else view.last_seen.timestamp()
        self.spool.continue_at(view.next_seq, int(seen * 1000) + 1)
        self._agreed = True

    def _sort_out(self, items: list[Item], refused: Refused) -> None:
        """Bury what the server names, or send less at once."""
        bad = _named(items, refused.items)
        if not bad and len(items) > 1:
            self._limit = len(items) // 2
            return
        if not bad and any(item.where.lstrip("/").startswith(("agent", "room")) for item in refused.items):
            raise refused
        if isinstance(refused, Conflict) and not self._conflict_told:
            self._conflict_told = True
            log.error(
                "numbers of agent %s are taken by other observations: does another agent run under this name? "
                "Each needs its own; what is refused is lost",
                self.spool.agent,
            )
        for item, reason in bad or [(items[0], str(refused))]:
            log.warning("observation %s/%d refused for good: %s", self.spool.agent, item.seq, reason)
            self.spool.bury(item, reason)

    def _pause(self, error: TownError, failures: int) -> float:
        if isinstance(error, Unreachable | Busy):
            return self._retry.pause(failures, error.retry_after_s if isinstance(error, Busy) else None)
        return self._pace.refused_s

    def _note(self, trouble: TownError | None) -> None:
        """Log the beginning and the end of a trouble, not every try."""
        if trouble is not None and type(trouble) is not type(self.trouble):
            log.warning("agent %s cannot post, keeps %d: %s", self.spool.agent, len(self.spool), trouble)
        elif trouble is None and self.trouble is not None:
            log.info("agent %s posts again", self.spool.agent)
        self.trouble = trouble


def _named(items: list[Item], problems: list[ProblemItem]) -> list[tuple[Item, str]]:
    """The items of the batch that the problem names, by seq, index or place, each once."""
    by_seq = {item.seq: item for item in items}
    bad: dict[int, tuple[Item, str]] = {}
    for problem in problems:
        place = re.search(r"observations[/.\[](\d+)", problem.where)
        index = problem.index if problem.index is not None else int(place[1]) if place else None
        item = by_seq.get(problem.seq) if problem.seq is not None else None
        if item is None and index is not None and 0 <= index < len(items):
            item = items[index]
        if item is not None:
            bad.setdefault(item.seq, (item, f"{problem.where}: {problem.why}"))
    return list(bad.values())
