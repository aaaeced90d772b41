"""Versions of a room as viewers see it, and what changed between two of them."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import NamedTuple, TypeVar

from tms_schemas.belief import LabelView, MoverView, ObjectPlacement
from tms_schemas.live import SnapshotFrame, StateFrame
from tms_schemas.rooms import RoomIn
from tms_server.town.state import LabelInfo
from tms_server.town.views import RoomView

Part = TypeVar("Part", ObjectPlacement, LabelView, MoverView)
_CACHED = 32
#: Slices below this are not drawn and do not count as moved.
_UNSEEN = 1e-3


class Basis(NamedTuple):
    """What a version was made from; rows that did not change are the same objects in the next state of the room."""

    room: RoomIn | None
    names: Mapping[str, str]
    labels: Mapping[str, tuple[LabelInfo, bool]]
    marginals: Mapping[str, Mapping[str, float]]

    @classmethod
    def of(cls, view: RoomView) -> Basis:
        state = view.fold.state
        labels = {name: (info, view.places.stale(info)) for name, info in state.labels.items()}
        return cls(state.room, state.names, labels, {tag: view.marginal(tag) for tag in view.tags})

    def changed_labels(self, before: Basis) -> set[str]:
        """Labels that are new, gone, moved, or silent now and were not before."""
        if self.room is not before.room:
            return {*self.labels, *before.labels}
        return {
            name
            for name in self.labels.keys() | before.labels.keys()
            if (new := self.labels.get(name)) is None
            or (old := before.labels.get(name)) is None
            or new[0] is not old[0]
            or new[1] != old[1]
        }


@dataclass(frozen=True, slots=True, eq=False)
class Version:
    """One state; parts that did not change are the very objects of the version before."""

    room: str
    cursor: int
    at: datetime | None
    objects: Mapping[str, ObjectPlacement]
    labels: Mapping[str, LabelView]
    movers: Mapping[str, MoverView]
    basis: Basis

    @classmethod
    def of(cls, view: RoomView, before: Version | None) -> Version:
        """The version of a view; ``before`` itself where nothing at all is different."""
        basis = Basis.of(view)
        movers = {one.label: one for one in view.movers().movers}
        if before is None:
            objects = {one.tag: one for one in view.placements().objects}
            labels = {one.label: one for one in view.labels().labels}
            return cls(view.room, view.cursor, view.at, objects, labels, movers, basis)
        moved = basis.changed_labels(before.basis)
        objects = {tag: _placement(tag, view, basis, before, moved) for tag in view.tags}
        new = cls(
            view.room,
            view.cursor,
            view.at,
            objects,
            _labels(view, basis, before, moved),
            _shared(movers, before.movers),
            basis,
        )
        same = (new.cursor, new.at) == (before.cursor, before.at) and not changed(new, before)
        return before if same else new


def snapshot(version: Version, tags: frozenset[str]) -> str:
    """A whole room as a frame; ``tags`` are the objects wanted, all where empty."""
    return SnapshotFrame(
        room=version.room,
        cursor=version.cursor,
        at=version.at,
        objects=[one for one in version.objects.values() if not tags or one.tag in tags],
        labels=list(version.labels.values()),
        movers=list(version.movers.values()),
    ).model_dump_json()


def changed(new: Version, old: Version) -> bool:
    """True where a part appeared, changed or went."""
    return any(
        after.keys() != before.keys() or any(after[key] is not before[key] for key in after)
        for after, before in ((new.objects, old.objects), (new.labels, old.labels), (new.movers, old.movers))
    )


def state(new: Version, old: Version, objects: list[ObjectPlacement], tags: frozenset[str]) -> str | None:
    """The frame from ``old`` to ``new`` with these changed objects; None where there is nothing to tell."""
    frame = StateFrame(
        room=new.room,
        cursor=new.cursor,
        at=new.at,
        objects=objects,
        objects_gone=[tag for tag in _gone(new.objects, old.objects) if not tags or tag in tags],
        labels=_changed(new.labels, old.labels),
        labels_gone=_gone(new.labels, old.labels),
        movers=_changed(new.movers, old.movers),
        movers_gone=_gone(new.movers, old.movers),
    )
    parts = (frame.objects, frame.objects_gone, frame.labels, frame.labels_gone, frame.movers, frame.movers_gone)
    return frame.model_dump_json() if any(parts) else None


def changed_objects(new: Version, old: Version, tags: frozenset[str]) -> list[ObjectPlacement]:
    return [one for one in _changed(new.objects, old.objects) if not tags or one.tag in tags]


class Encoder:
    """Encodes once what several viewers with the same filter need: the newest snapshots and steps are kept."""

    def __init__(self) -> None:
        self._frames: OrderedDict[tuple[Version, Version | None, frozenset[str]], str | None] = OrderedDict()

    def snapshot(self, version: Version, tags: frozenset[str]) -> str:
        key = (version, None, tags)
        if key not in self._frames:
            self._keep(key, snapshot(version, tags))
        return self._frames[key] or ""

    def state(self, new: Version, old: Version, tags: frozenset[str]) -> str | None:
        key = (new, old, tags)
        if key not in self._frames:
            self._keep(key, state(new, old, changed_objects(new, old, tags), tags))
        return self._frames[key]

    def _keep(self, key: tuple[Version, Version | None, frozenset[str]], frame: str | None) -> None:
        self._frames[key] = frame
        if len(self._frames) > _CACHED:
            self._frames.popitem(last=False)


def _placement(tag: str, view: RoomView, basis: Basis, before: Version, moved: set[str]) -> ObjectPlacement:
    """The pie of before where it would look the same: making all of them anew for each step of a walker is dear.

    A slice that nobody sees does not count as moved.
    """
    old, marginal = before.objects.get(tag), basis.marginals[tag]
    if (
        old is not None
        and old.name == basis.names[tag]
        and marginal == before.basis.marginals[tag]
        and not any(label in moved and p >= _UNSEEN for label, p in marginal.items())
    ):
        return old
    return view.placement(tag)


def _labels(view: RoomView, basis: Basis, before: Version, moved: set[str]) -> Mapping[str, LabelView]:
    still = moved.isdisjoint(before.labels) and all(
        name in basis.labels and basis.labels[name][0].kind == "mover" for name in moved
    )
    if still and basis.marginals == before.basis.marginals:
        return before.labels
    return _shared({one.label: one for one in view.labels().labels}, before.labels)


def _shared(parts: dict[str, Part], before: Mapping[str, Part]) -> dict[str, Part]:
    return {key: old if (old := before.get(key)) is not None and old == part else part for key, part in parts.items()}


def _changed(new: Mapping[str, Part], old: Mapping[str, Part]) -> list[Part]:
    return [part for key, part in new.items() if old.get(key) is not part]


def _gone(new: Mapping[str, Part], old: Mapping[str, Part]) -> list[str]:
    return [key for key in old if key not in new]
