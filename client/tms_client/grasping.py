"""What one robot hand does, as observations: grasp, carry, put down, lose.

Pure: times and positions come in, observations go out with ``seq`` 0, which the spool replaces. Which event says what:

* **grasp**: ``label_appeared`` of kind ``robot``; what takes the thing from its former place is that place's own
  ``label_vanished``. Things this agent put down itself are seen by nobody else, so their label goes too: with a tag
  read it vanishes and the grasp appears, which holds also where somebody took the thing meanwhile and brought it back;
  without a tag the grasp at the same place is a ``transfer`` back, the only thing that says it is the same one.
* **put down where no sensor sees it**: ``transfer`` to a label of its own. **Where a sensor sees it** (smart cabinet,
  floor under a laser) or into a person's hand: ``label_vanished``; that sensor tells where it appears.
* **lost**: ``label_moved`` to where it happened, then ``label_vanished``; the floor's laser or a cabinet sees it next.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import datetime
from typing import Any, Literal

from pydantic import TypeAdapter

from tms_schemas.base import LabelId, Metres, Model, Tag, UtcTime, Xy
from tms_schemas.events import Covariance, ExclusiveKind, Near
from tms_schemas.observation import (
    InventoryLabel,
    LabelAppeared,
    LabelMoved,
    LabelVanished,
    Observation,
    TagMissed,
    TagObserved,
    Transfer,
)

#: Where a hand lets go: on furniture, on the floor, in a smart cabinet, into a person's hand.
Onto = Literal["table", "floor", "cabinet", "person"]
#: Reads of one tag posted per grasp: the second is for a grasp that was told before the thing's former place told.
_READS = 2
#: Tags remembered of one grasp: a reader that reads nonsense fills no memory.
_MOST_TAGS = 100
#: Things put down that an agent remembers; beyond it the oldest counts as taken away.
_MOST_PUT_DOWN = 1000
_TIME, _TAG = TypeAdapter(UtcTime), TypeAdapter(Tag)


class Held(Model):
    """What is in the hand. ``tag`` was read, or belongs to a thing put down here before that was grasped again."""

    label: LabelId
    xy: Xy
    z: Metres | None = None
    tag: Tag | None = None
    reads: dict[Tag, int] = {}
    missed: bool = False


class PutDown(Model):
    """What the agent put down where no sensor sees it."""

    label: LabelId
    kind: ExclusiveKind
    xy: Xy
    z: Metres | None = None
    surface: str | None = None
    tag: Tag | None = None


class Table(Model):
    """What the hands of one agent put down: share it among them, so that one may grasp what the other put down.

    ``last`` is the time of the newest observation of any of them.
    """

    things: dict[LabelId, PutDown] = {}
    last: UtcTime | None = None


class _State(Model):
    held: Held | None = None
    table: Table


class Gripper:
    """One hand. Every call returns the observations to post, in order; a call that changes nothing returns none.

    Args:
        new_label: gives label ids that the agent never used (``Spool.new_label``).
        step_m: movements of the held thing shorter than this are not told.
        same_place_m: a grasp without a tag this near to a thing put down takes that thing.
        table: what the agent's hands put down; own by default.
    """

    def __init__(
        self,
        new_label: Callable[[], str],
        *,
        step_m: float = 0.05,
        same_place_m: float = 0.1,
        table: Table | None = None,
    ) -> None:
        self._new_label, self._step_m, self._same_place_m = new_label, step_m, same_place_m
        self.held: Held | None = None
        self.table = Table() if table is None else table

    def grasped(
        self,
        at: datetime,
        xy: Xy,
        *,
        tag: str | None = None,
        z: float | None = None,
        cov: Covariance | None = None,
        weight_g: float | None = None,
    ) -> list[Observation]:
        """A thing is in the hand, lifted from where it was. ``tag`` None: no reader, or it has read nothing yet.

        A hand that holds a thing of another tag has lost that; the same thing again changes nothing. ``at`` should be
        when it is lifted, not when the fingers close: its former place tells no earlier that it is gone.

        Raises:
            ValueError: a tag, time or position that the wire cannot carry; nothing has changed.
        """
        tag = None if tag is None else _TAG.validate_python(tag)
        if self.held is not None and (self.held.tag is None or tag in (None, self.held.tag)):
            known = tag == self.held.tag
            return self.moved(at, xy, z=z, cov=cov) + ([] if tag is None or known else self.read(at, tag))
        now, label = self._time(at), self._new_label()
        new = Held.model_validate({"label": label, "xy": xy, "z": z, "tag": tag})
        place: dict[str, Any] = {"xy": xy} | _given(z=z, cov=cov)
        again = self._at_place(new.xy) if new.tag is None else None
        grasp: Observation
        if again is None:
            read = _given(tag=new.tag, weight_g=weight_g)
            grasp = LabelAppeared(seq=0, observed_at=now, label=label, kind="robot", **place, **read)
            new.reads = {} if new.tag is None else {new.tag: 1}
        else:
            grasp = Transfer(seq=0, observed_at=now, from_=again.label, to=label, kind="robot", **place)
            new.tag = again.tag
        # Everything is valid: from here on the state changes.
        found = self.dropped(at)
        if again is not None:
            del self.table.things[again.label]
        elif new.tag is not None:
            found += self._gone(now, [one for one in self.table.things.values() if one.tag == new.tag])
        self.held = new
        self._told(now)
        return [*found, grasp]

    def read(self, at: datetime, tag: str) -> list[Observation]:
        """The hand's reader reads ``tag``. Posted twice per grasp and tag; the caller settles which of several."""
        if self.held is None:
            return []
        held, tag = self.held, _TAG.validate_python(tag)
        count = held.reads.get(tag, 0)
        if count >= _READS:
            return []
        elsewhere = any(one.tag == tag for one in self.table.things.values())
        if not held.reads and (elsewhere or held.tag not in (None, tag)):
            # It was taken for another thing. A read moves nothing in the belief: the grasp is told anew.
            return self.dropped(at) + self.grasped(at, held.xy, tag=tag, z=held.z)
        reads = dict([*held.reads.items(), (tag, count + 1)][-_MOST_TAGS:])
        known = held.tag if held.reads else tag  # a second tag is a neighbour's
        read = TagObserved(seq=0, observed_at=self._time(at), label=held.label, tag=tag)
        self.held = held.model_copy(update={"tag": known, "reads": reads})
        self._told(read.observed_at)
        return [read]

    def missed(self, at: datetime) -> list[Observation]:
        """The hand's reader works and reads no tag of what is held. Posted once per grasp, before any read."""
        if self.held is None or self.held.missed or self.held.reads:
            return []
        missed = TagMissed(seq=0, observed_at=self._time(at), label=self.held.label)
        self.held = self.held.model_copy(update={"missed": True})
        self._told(missed.observed_at)
        return [missed]

    def moved(self, at: datetime, xy: Xy, z: float | None = None, cov: Covariance | None = None) -> list[Observation]:
        """The hand is there now, with what it holds."""
        if self.held is None or _gap(self.held, xy, z) < self._step_m:
            return []
        place: dict[str, Any] = {"xy": xy} | _given(z=z, cov=cov)
        moved = LabelMoved(seq=0, observed_at=self._time(at), label=self.held.label, **place)
        self.held = self.held.model_copy(update={"xy": moved.xy} | _given(z=z))
        self._told(moved.observed_at)
        return [moved]

    def released(
        self,
        at: datetime,
        xy: Xy,
        *,
        kind: Onto = "table",
        surface: str | None = None,
        z: float | None = None,
        cov: Covariance | None = None,
        watched: bool | None = None,
    ) -> list[Observation]:
        """The thing is out of the hand, at ``xy``.

        Args:
            kind: onto what.
            surface: ``furniture/surface``.
            watched: a sensor sees what is there and tells it. By default smart cabinets and the floor are watched and
                tables are not. Say True for an instrumented table, False for a floor without a laser.
        """
        if self.held is None:
            return []
        held, now = self.held, self._time(at)
        if kind == "person":
            handed = LabelVanished(seq=0, observed_at=now, label=held.label, dest=Near(xy=xy))
            self.held = None
            self._told(now)
            return [handed]
        if kind != "table" if watched is None else watched:
            return self.dropped(at, xy)
        place: dict[str, Any] = {"xy": xy} | _given(z=z, surface=surface)
        thing = PutDown(label=self._new_label(), kind=kind, tag=held.tag, **place)
        put = Transfer(seq=0, observed_at=now, from_=held.label, to=thing.label, kind=kind, **place, **_given(cov=cov))
        self.held = None
        self._told(now)
        # Two hands may have read the same tag, one of them a neighbour's: the last one put down is taken to bear it.
        for one in [one for one in self.table.things.values() if one.tag is not None and one.tag == thing.tag]:
            self.table.things[one.label] = one.model_copy(update={"tag": None})
        self.table.things[thing.label] = thing
        return [put, *self._gone(now, list(self.table.things.values())[:-_MOST_PUT_DOWN])]

    def dropped(self, at: datetime, xy: Xy | None = None) -> list[Observation]:
        """The thing is out of the hand and nobody put it anywhere; ``xy`` is where that happened."""
        if self.held is None:
            return []
        moved = [] if xy is None else self.moved(at, xy)
        gone = LabelVanished(seq=0, observed_at=self._time(at), label=self.held.label)
        self.held = None
        self._told(gone.observed_at)
        return [*moved, gone]

    def labels(self) -> list[InventoryLabel]:
        """All labels of the hand and its table now, for the agent's ``inventory`` when it connects."""
        found = [
            InventoryLabel(label=one.label, kind=one.kind, xy=one.xy, **_given(z=one.z, surface=one.surface))
            for one in self.table.things.values()
        ]
        if self.held is not None:
            held = self.held
            read = held.tag if held.reads else None
            found.append(InventoryLabel(label=held.label, kind="robot", xy=held.xy, **_given(z=held.z, tag=read)))
        return found

    def to_dict(self) -> dict[str, Any]:
        """State that survives a restart, JSON types."""
        return _State(held=self.held, table=self.table).model_dump(mode="json")

    def restore(self, state: dict[str, Any]) -> None:
        """Continue where ``to_dict`` was; a shared table takes up what that one had.

        Raises:
            ValueError: it is no such state.
        """
        known = _State.model_validate(state)
        self.held = known.held
        self.table.things.update(known.table.things)
        self._told(known.table.last)

    def _time(self, at: datetime) -> datetime:
        """``at``, or the time of the observation before where the clock was set back: order is by time."""
        at = _TIME.validate_python(at)
        return at if self.table.last is None else max(at, self.table.last)

    def _told(self, now: datetime | None) -> None:
        if now is not None:
            self.table.last = self._time(now)

    def _gone(self, now: datetime, things: list[PutDown]) -> list[Observation]:
        """Forget things put down: they are there no more, or there are too many."""
        for one in things:
            del self.table.things[one.label]
        return [LabelVanished(seq=0, observed_at=now, label=one.label) for one in things]

    def _at_place(self, xy: Xy) -> PutDown | None:
        """The thing put down nearest to ``xy``, if it is near enough."""
        near = min(self.table.things.values(), key=lambda one: math.dist(one.xy, xy), default=None)
        if near is None or math.dist(near.xy, xy) > self._same_place_m:
            return None
        return near


def _gap(held: Held, xy: Xy, z: float | None) -> float:
    up = 0.0 if z is None or held.z is None else z - held.z
    return math.hypot(xy[0] - held.xy[0], xy[1] - held.xy[1], up)


def _given(**fields: Any) -> dict[str, Any]:
    """Only the fields that are known: absent and null are not the same on the wire."""
    return {name: value for name, value in fields.items() if value is not None}
