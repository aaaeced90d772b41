"""From what the estimator tells to observations: movers now and then, things at once and with the time it happened."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from tms_agents.floor import Appeared, Back, Confused, FloorEvent, FloorLabel, Met, Moved, Vanished
from tms_schemas.events import Near
from tms_schemas.observation import (
    HandoverPossible,
    InventoryLabel,
    LabelAppeared,
    LabelMoved,
    LabelVanished,
    MoverEntered,
    MoverLeft,
    MoverSwap,
    Observation,
    Transfer,
)

#: A covariance smaller than this claims more than any installer measures (5 mm).
_LEAST_VARIANCE = 2.5e-5
#: One who is this sure to have acted is named, or a little less where nobody else comes into question; otherwise the
#: server weighs who was near.
_SURE, _ALONE, _NOBODY = 0.9, 0.6, 0.05
#: How long it is remembered where a mover was, and in how many places at most.
_REMEMBER_S, _PLACES = 120.0, 600
#: At rest a mover's place is told once more when it is known better by this.
_REST_M, _REST_S = 0.05, 1.0
_STEP_S = 1e-3

Xy = tuple[float, float]
Cov = tuple[float, float, float]


@dataclass(slots=True)
class Mover:
    """What was told of a mover, and where it was (sensor times); ``label`` None: a robot, which reports itself."""

    label: str | None
    entered: float
    told_at: float
    told_xy: Xy
    xy: Xy
    moved_at: float
    cov: Cov
    places: deque[tuple[float, Xy]] = field(default_factory=lambda: deque(maxlen=_PLACES))
    left: float = math.inf

    def at(self, t: float) -> Xy:
        """Where it was then, as far as that is remembered."""
        return min(self.places, key=lambda place: abs(place[0] - t))[1]

    def nearest(self, xy: Xy, since: float, until: float) -> float | None:
        """When it was nearest to a place, the first time of several."""
        during = [(math.dist(there, xy), t) for t, there in self.places if since <= t <= until]
        return min(during)[1] if during else None


class Labels:
    """Label ids of the room for the estimator's numbers. ``utc`` tells the time of day of a sensor time.

    ``told_until``: the sensor time of the last inventory; nothing is told to have happened before that, because an
    inventory says how things were then.
    """

    def __init__(
        self,
        new_label: Callable[[], str],
        utc: Callable[[float], datetime],
        *,
        report_m: float = 0.25,
        report_s: float = 0.5,
        tells_robots: bool = False,
    ) -> None:
        self._new_label, self._utc = new_label, utc
        self._report_m, self._report_s, self._tells_robots = report_m, report_s, tells_robots
        #: Of things: label, place and when it was told to have appeared; of movers that are here or were until lately.
        self.things: dict[int, tuple[str, Xy, float]] = {}
        self.movers: dict[int, Mover] = {}
        self.told_until = -math.inf

    def observations(self, events: Sequence[FloorEvent]) -> list[Observation]:
        """What is to be posted of the events of one scan; vanish, mover, appear, each with its time."""
        made = [one for event in sorted(events, key=_rank) for one in self._told(event)]
        if events:
            self._forget(events[0].t)
        return made

    def rest(self, t: float) -> list[Observation]:
        """Where movers came to rest; to be asked a few times a second."""
        found: list[Observation] = []
        for mover in self.movers.values():
            gap = math.dist(mover.xy, mover.told_xy)
            if gap > _REST_M / 2 and t - mover.moved_at >= _REST_S and math.isinf(mover.left):
                found += self._moved(mover, mover.moved_at)
        return found

    def inventory(self, labels: Iterable[FloorLabel], t: float) -> list[InventoryLabel]:
        """Everything that is here; what has no label yet gets one."""
        here = list(labels)
        now = {one.id for one in here}
        self.things = {number: thing for number, thing in self.things.items() if number in now}
        self.movers = {number: mover for number, mover in self.movers.items() if number in now}
        self.told_until = t
        listed = []
        for one in here:
            if one.kind == "object":
                label = self.things[one.id][0] if one.id in self.things else self._new_label()
                self.things[one.id] = (label, one.xy, t)
                listed.append(InventoryLabel(label=label, kind="floor", **_place(one.xy, one.cov)))
            else:
                known = self.movers.get(one.id)
                mover = known or self._meet(one.id, one.robot, t, one.xy, one.cov)
                mover.told_at, mover.told_xy = t, one.xy
                if mover.label is not None:
                    listed.append(InventoryLabel(label=mover.label, kind="mover", **_place(one.xy, one.cov)))
        return listed

    def begin_anew(self) -> None:
        """The estimator's numbers begin anew; an inventory makes the server forget the labels of the old ones."""
        self.things, self.movers = {}, {}

    def to_dict(self) -> dict[str, Any]:
        here = {number: mover for number, mover in self.movers.items() if math.isinf(mover.left)}
        return {
            "things": {str(number): [label, *xy, t] for number, (label, xy, t) in self.things.items()},
            "movers": {str(number): [one.label, *one.xy, *one.cov, one.entered] for number, one in here.items()},
        }

    def restore(self, saved: dict[str, Any]) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``to_dict`` gave."""
        things = {
            int(number): (str(label), (float(x), float(y)), float(t))
            for number, (label, x, y, t) in saved["things"].items()
        }
        movers = {}
        for number, (label, x, y, xx, xy, yy, entered) in saved["movers"].items():
            at = (float(x), float(y))
            mover = Mover(label, entered, entered, at, at, entered, (float(xx), float(xy), float(yy)))
            mover.places.append((float(entered), at))
            movers[int(number)] = mover
        self.things, self.movers = things, movers

    # below: one event

    def _told(self, event: FloorEvent) -> Iterator[Observation]:
        if isinstance(event, Appeared):
            yield from self._entered(event) if event.kind == "mover" else self._lies(event)
        elif isinstance(event, Vanished):
            yield from self._left(event) if event.label in self.movers else self._taken(event)
        elif isinstance(event, Moved | Back) and (mover := self.movers.get(event.label)) is not None:
            yield from self._walks(mover, event)
        elif isinstance(event, Confused):
            yield from self._swapped(event)
        elif isinstance(event, Met):
            yield from self._met(event)

    def _entered(self, event: Appeared) -> Iterator[Observation]:
        t = self._after(min(event.since or event.t, event.t))
        mover = self._meet(event.label, event.robot, t, event.xy, event.cov)
        if mover.label is not None:
            at = self._utc(t)
            yield MoverEntered(seq=0, observed_at=at, label=mover.label, **_place(event.xy, event.cov))

    def _meet(self, number: int, robot: bool, t: float, xy: Xy, cov: Cov) -> Mover:
        label = None if robot and not self._tells_robots else self._new_label()
        mover = self.movers[number] = Mover(label, t, t, xy, xy, t, cov)
        mover.places.append((t, xy))
        return mover

    def _walks(self, mover: Mover, event: Moved | Back) -> Iterator[Observation]:
        if math.dist(event.xy, mover.xy) > 0.01:
            mover.moved_at = event.t
        mover.xy, mover.cov = event.xy, event.cov
        mover.places.append((event.t, event.xy))
        gap = math.dist(event.xy, mover.told_xy)
        if gap >= self._report_m or (gap >= _REST_M and event.t - mover.told_at >= self._report_s):
            yield from self._moved(mover, event.t)

    def _moved(self, mover: Mover, t: float) -> list[Observation]:
        t = max(self._after(t), mover.told_at + _STEP_S)
        mover.told_at, mover.told_xy = t, mover.xy
        if mover.label is None:
            return []
        return [LabelMoved(seq=0, observed_at=self._utc(t), label=mover.label, **_place(mover.xy, mover.cov))]

    def _left(self, event: Vanished) -> Iterator[Observation]:
        mover = self.movers[event.label]
        mover.left = max(self._after(event.t), mover.told_at + _STEP_S)
        if mover.label is None:
            return
        same = None if event.into is None else self.movers.get(event.into)
        at = self._utc(mover.left)
        if same is not None and same.label is not None:
            yield Transfer(seq=0, observed_at=at, from_=mover.label, to=same.label)
        else:
            yield MoverLeft(seq=0, observed_at=at, label=mover.label)

    def _swapped(self, event: Confused) -> Iterator[Observation]:
        """Told for the time when they met: what was done since was done by who they may be."""
        for at, a, b in self._both(event):
            yield MoverSwap(seq=0, observed_at=at, a=a, b=b, p=event.p)

    def _met(self, event: Met) -> Iterator[Observation]:
        """How likely it is that something changed hands is a parameter of the room: lasers do not see it."""
        for at, a, b in self._both(event):
            yield HandoverPossible(seq=0, observed_at=at, a=a, b=b)

    def _both(self, event: Confused | Met) -> Iterator[tuple[datetime, str, str]]:
        """When it was, while both were there, and their labels; nothing of robots that report themselves."""
        one, other = self.movers.get(event.label), self.movers.get(event.other)
        if one is None or other is None or one.label is None or other.label is None:
            return
        t = self._after(max(event.since, one.entered + _STEP_S, other.entered + _STEP_S))
        if t < min(one.left, other.left):
            yield self._utc(t), one.label, other.label

    def _lies(self, event: Appeared) -> Iterator[Observation]:
        t = self._after(min(event.since or event.t, event.t))
        label = self._new_label()
        self.things[event.label] = (label, event.xy, t)
        who = self._who(event.candidates, t)
        told: dict[str, Any] = {} if who is None else {"source": who}
        if event.width_m is not None:
            told["size_m"] = round(event.width_m, 4)
        place = _place(event.xy, event.cov)
        yield LabelAppeared(seq=0, observed_at=self._utc(t), label=label, kind="floor", **place, **told)

    def _taken(self, event: Vanished) -> Iterator[Observation]:
        """Told for the time when the likeliest one was nearest: what is taken unseen is known seconds later."""
        if (thing := self.things.pop(event.label, None)) is None:
            return
        label, xy, since = thing
        likeliest = max(event.candidates, key=lambda one: one[1], default=None)
        mover = self.movers.get(likeliest[0]) if likeliest is not None else None
        near = mover.nearest(xy, event.earliest, event.latest) if mover is not None else None
        t = max(self._after(event.latest if near is None else near), since + _STEP_S)
        who = self._who(event.candidates, t)
        told: dict[str, Any] = {} if who is None else {"dest": who}
        yield LabelVanished(seq=0, observed_at=self._utc(t), label=label, **told)

    def _who(self, candidates: Sequence[tuple[int, float]], t: float) -> str | Near | None:
        """The mover that acted, if that is sure and it was here then; robots are named by where they were."""
        (number, p), (_, next_p) = sorted([*candidates, (-1, 0.0), (-1, 0.0)], key=lambda one: -one[1])[:2]
        mover = self.movers.get(number)
        sure = p >= _SURE or (p >= _ALONE and next_p <= _NOBODY)
        if not sure or mover is None or not mover.entered <= t <= mover.left:
            return None
        return mover.label or Near(xy=_rounded(mover.at(t)))

    def _after(self, t: float) -> float:
        return max(t, self.told_until + _STEP_S)

    def _forget(self, t: float) -> None:
        self.movers = {number: mover for number, mover in self.movers.items() if t - mover.left < _REMEMBER_S}


def _rank(event: FloorEvent) -> tuple[float, int]:
    if isinstance(event, Appeared):
        return (event.t, 3 if event.kind == "object" else 2)
    return (event.t, 0 if isinstance(event, Vanished) else 1)


def _place(xy: Xy, cov: Cov) -> dict[str, Any]:
    xx, xy_, yy = cov
    return {"xy": _rounded(xy), "cov": (max(xx, _LEAST_VARIANCE), xy_, max(yy, _LEAST_VARIANCE))}


def _rounded(xy: Xy) -> Xy:
    return (round(xy[0], 4), round(xy[1], 4))
