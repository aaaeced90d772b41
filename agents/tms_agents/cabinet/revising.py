"""Make the shelf what an outcome says, with as few events as possible."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from tms_agents.cabinet.episodes import Episode, Outcome
from tms_agents.cabinet.events import Appeared, CabinetEvent, Moved, Vanished
from tms_agents.cabinet.geometry import Array, KnownWeight
from tms_agents.cabinet.stays import Shelf, Thing

#: A stay whose load changed by so much was slid; less is only known better.
_SLID_G, _SLID_SHARE = 8.0, 0.05
#: A place that is so much nearer to the truth is told.
_MOVED_M = 0.03


def current(episode: Episode, shelf: Shelf) -> tuple[frozenset[int], tuple[str | None, ...]]:
    """What the shelf says of the episode, as ``gone`` and ``new`` of an outcome."""
    before = {thing.id: thing for thing in episode.things}
    gone = {i for i in before if i not in shelf.things}
    new = [thing.tag for i, thing in shelf.things.items() if i not in before]
    for i in before.keys() & shelf.things.keys():
        if _slid(before[i], shelf.things[i]):
            gone.add(i)
            new.append(shelf.things[i].tag)
    return frozenset(gone), order(new)


def order(tags: Iterable[str | None]) -> tuple[str | None, ...]:
    """Tags in one order, those that are None last."""
    return tuple(sorted(tags, key=lambda tag: (tag is None, tag or "")))


def _slid(before: Thing, now: Thing) -> bool:
    far = np.abs(now.load - before.load).max()
    return bool(far > _SLID_G + _SLID_SHARE * abs(float(before.load.sum())) + 3 * np.sqrt(before.variance.max()))


class Revision:
    """One outcome on one shelf. ``pin`` and ``left`` tell the keeper of tags what happened."""

    def __init__(
        self,
        shelf: Shelf,
        episode: Episode,
        outcome: Outcome,
        now: float,
        *,
        pin: Callable[[float, Thing, str], CabinetEvent],
        left: Callable[[Thing], None],
        weight: Callable[[str], KnownWeight | None],
    ) -> None:
        self._shelf, self._episode, self._outcome, self._now = shelf, episode, outcome, now
        self._pin, self._left, self._weight = pin, left, weight

    def events(self) -> list[CabinetEvent]:
        """Change the shelf and tell of it: first what is not there, then what is."""
        self._told_apart()
        before = {thing.id: thing for thing in self._episode.things}
        wanted = list(self._outcome.new)
        events: list[CabinetEvent] = []
        stays: list[Thing] = []
        back: list[Thing] = []
        for i, old in before.items():
            now = self._shelf.things.get(i)
            if now is None and i not in self._outcome.gone:
                back.append(old)
            elif now is not None and i in self._outcome.gone:
                if now.tag in wanted:
                    # Lifted and put down so quickly that nobody saw the board without it, or slid.
                    wanted.remove(now.tag)
                    stays.append(now)
                else:
                    events.append(self._remove(now))
            elif now is not None and _slid(old, now):
                now.load, now.variance = old.load.copy(), old.variance.copy()
                now.forget_place()
                at = now.centre(self._shelf.geometry)
                now.told = at.xy
                events.append(Moved(self._now, now.id, at.xy, at.cov))
        fresh = [thing for i, thing in self._shelf.things.items() if i not in before]
        for thing in list(fresh):
            if thing.tag in wanted:
                wanted.remove(thing.tag)
                stays.append(thing)
                fresh.remove(thing)
        later: list[CabinetEvent] = []
        for thing in list(fresh):
            if thing.tag is None and wanted:
                tag = wanted.pop(0)
                if tag is not None:
                    later.append(self._pin(self._now, thing, tag))
                stays.append(thing)
                fresh.remove(thing)
        events += [self._remove(thing) for thing in fresh]
        for old in back:
            events += self._put(old.load, old.variance, old.tag, back=old)
            # A stay is never used again: from now on this is the one that stood there before.
            old.id = self._shelf.next_id - 1
        known = set(self._shelf.things)
        events += self._share(stays, wanted)
        new = [*stays, *(thing for i, thing in self._shelf.things.items() if i not in known)]
        if new and (partners := self._shelf.partners(self._outcome.gone)):
            events.append(self._shelf.join(self._now, [*partners, *new], self._outcome.gone))
        return events + later

    def _told_apart(self) -> None:
        """Some of a group have gone and nothing came: that tells where the others stand, now and before."""
        gone = self._outcome.gone
        old = [thing for thing in self._episode.things if thing.id not in gone and thing.joint & gone]
        if not old or self._outcome.new:
            return
        self._shelf.tell_apart(old, gone, self._outcome.load, self._outcome.variance)
        for thing in old:
            now = self._shelf.things.get(thing.id)
            if now is not None:
                now.load, now.variance, now.joint = thing.load.copy(), thing.variance.copy(), thing.joint

    def _remove(self, thing: Thing) -> Vanished:
        self._left(thing)
        at = thing.centre(self._shelf.geometry)
        del self._shelf.things[thing.id]
        return Vanished(self._now, thing.id, at.weight_g, at.weight_sd_g)

    def _share(self, stays: list[Thing], wanted: list[str | None]) -> list[CabinetEvent]:
        """Give the new things their loads."""
        load, variance = self._outcome.load, self._outcome.variance
        if len(stays) + len(wanted) == 1:
            if wanted:
                return self._put(load, variance, wanted[0])
            stays[0].load, stays[0].variance, stays[0].joint = load.copy(), variance.copy(), frozenset()
            stays[0].forget_place()
            return self._tell(stays)
        rest = load - sum((thing.load for thing in stays), np.zeros_like(load))
        if len(wanted) == 1:
            least = min(5.0, 0.2 * float(load.sum()))
            if float(rest.sum()) > least:
                errors = variance + sum((thing.variance for thing in stays), np.zeros_like(load))
                return self._put(rest, errors, wanted[0])
        if not wanted:
            total = sum((thing.variance for thing in stays), np.zeros_like(load))
            for thing in stays:
                thing.load = thing.load + rest * thing.variance / np.maximum(total, 1e-9)
            return self._tell(stays)
        return self._only_the_sum(stays, wanted)

    def _only_the_sum(self, stays: list[Thing], wanted: list[str | None]) -> list[CabinetEvent]:
        """Nobody can tell what the old and the new ones weigh and where they stand; known weights help."""
        load, events = self._outcome.load, list[CabinetEvent]()
        tags = [*(thing.tag for thing in stays), *wanted]
        parts = _parts([None if tag is None else self._weight(tag) for tag in tags], float(load.sum()))
        guesses = [(part * load, (0.35 * part * float(load.sum())) ** 2 + np.zeros_like(load)) for part in parts]
        together = list(stays)
        for thing, (share, guess) in zip(stays, guesses, strict=False):
            thing.load, thing.variance = share, guess
            thing.forget_place()
        for tag, (share, guess) in zip(wanted, guesses[len(stays) :], strict=True):
            events += self._put(share, guess, tag)
            together.append(self._shelf.things[self._shelf.next_id - 1])
        return [*events, self._shelf.join(self._now, together)]

    def _put(self, load: Array, variance: Array, tag: str | None, back: Thing | None = None) -> list[CabinetEvent]:
        since, earliest = (self._episode.onset, self._episode.earliest) if back is None else (back.since, back.since)
        thing = self._shelf.put(load.copy(), variance.copy(), since=since, onset=earliest)
        events: list[CabinetEvent] = []
        at = thing.centre(self._shelf.geometry)
        thing.told = at.xy
        events.append(Appeared(self._now, thing.id, at.xy, at.cov, at.weight_g, at.weight_sd_g))
        if tag is not None:
            events.append(self._pin(self._now, thing, tag))
        return events

    def _tell(self, stays: list[Thing]) -> list[CabinetEvent]:
        events: list[CabinetEvent] = []
        for thing in stays:
            at = thing.centre(self._shelf.geometry)
            if float(np.hypot(*np.subtract(at.xy, thing.told))) > _MOVED_M:
                thing.told = at.xy
                events.append(Moved(self._now, thing.id, at.xy, at.cov))
        return events


def _parts(known: Sequence[KnownWeight | None], total: float) -> list[float]:
    """Shares of a sum of loads of which only some weights are known."""
    weights = [None if one is None else max(one.mean_g, 1.0) for one in known]
    rest = max(total - sum(one for one in weights if one is not None), 0.05 * abs(total))
    unknown = sum(one is None for one in weights)
    shares = [rest / unknown if one is None else one for one in weights]
    return [share / sum(shares) for share in shares]
