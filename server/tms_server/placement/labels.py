"""The labels of a room: names, kinds and positions, each in a small integer slot that hypotheses refer to."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tms_schemas.events import Kind
from tms_server.placement.specs import OUT, InvalidEvent, LabelSpec, LabelState

#: The slot of OUT; it is no label.
OUT_SLOT = 0


class Label(NamedTuple):
    """One label; ``xy`` in metres."""

    id: str
    kind: Kind
    xy: tuple[float, float]
    ghost: bool


class Labels:
    """Active labels and ghosts. Slots of labels that are gone are given out again, the lowest first."""

    def __init__(self) -> None:
        self._slot_of: dict[str, int] = {}
        self._labels: dict[int, Label] = {}
        self._free: list[int] = []
        self.n_slots = 1  # slot 0 is OUT
        #: Slots of active movers and of ghosts, in order of appearance.
        self.movers: list[int] = []
        self.ghosts: list[int] = []
        self._shelf = np.zeros(64, np.bool_)

    def shelf(self) -> NDArray[np.bool_]:
        """Per slot, [S + 1]: an active label that holds at most one object."""
        return self._shelf[: self.n_slots + 1].copy()

    def __getitem__(self, slot: int) -> Label:
        return self._labels[slot]

    def __iter__(self) -> Iterator[tuple[int, Label]]:
        return iter(self._labels.items())

    def name(self, slot: int) -> str:
        """The label's id; ``OUT`` for slot 0."""
        return OUT if slot == OUT_SLOT else self._labels[slot].id

    def names(self, slots: list[int]) -> list[str]:
        """The same for many."""
        labels = self._labels
        return [OUT if slot == OUT_SLOT else labels[slot].id for slot in slots]

    def states(self) -> dict[str, LabelState]:
        """Every label by id, in order of appearance."""
        return {label.id: LabelState(label.kind, label.xy, label.ghost) for label in self._labels.values()}

    def active(self, name: Any) -> int:
        """The slot of an active label.

        Raises:
            InvalidEvent: it is a ghost, gone, never appeared, or not a name at all.
        """
        if not isinstance(name, str):
            raise InvalidEvent("a mover given by position must be resolved to a label first")
        slot = self._slot_of.get(name)
        if slot is None or self._labels[slot].ghost:
            raise InvalidEvent(f"label {name!r} is not active")
        return slot

    def mover(self, name: Any) -> int:
        """The slot of an active mover; InvalidEvent otherwise."""
        slot = self.active(name)
        if self._labels[slot].kind != "mover":
            raise InvalidEvent(f"label {name!r} is not a mover")
        return slot

    def exclusive(self, name: Any) -> int:
        """The slot of an active label that holds at most one object; InvalidEvent otherwise."""
        slot = self.active(name)
        if self._labels[slot].kind == "mover":
            raise InvalidEvent(f"label {name!r} is a mover")
        return slot

    def slot(self, name: str) -> int:
        """The slot of a label, ghost or OUT; KeyError if there is none."""
        return OUT_SLOT if name == OUT else self._slot_of[name]

    def check_new(self, name: str) -> None:
        """InvalidEvent if the id is taken by a label or a ghost."""
        if name == OUT or name in self._slot_of:
            raise InvalidEvent(f"label {name!r} exists already")

    def add(self, name: str, kind: Kind, xy: tuple[float, float], slot: int | None = None) -> int:
        """A new active label; returns its slot. InvalidEvent if the id is taken."""
        self.check_new(name)
        if slot is None:
            slot = heapq.heappop(self._free) if self._free else self.n_slots
            self.n_slots = max(self.n_slots, slot + 1)
        self._slot_of[name] = slot
        self._labels[slot] = Label(name, kind, (float(xy[0]), float(xy[1])), False)
        if slot + 2 > self._shelf.size:
            self._shelf = np.concatenate([self._shelf, np.zeros(slot + 2, np.bool_)])
        self._shelf[slot] = kind != "mover"
        if kind == "mover":
            self.movers.append(slot)
        return slot

    def move(self, slot: int, xy: tuple[float, float]) -> None:
        """The label is at ``xy`` now."""
        self._labels[slot] = self._labels[slot]._replace(xy=(float(xy[0]), float(xy[1])))

    def rename(self, slot: int, name: str, kind: Kind, xy: tuple[float, float]) -> None:
        """The label in this slot becomes another one; whatever is there stays in the slot."""
        self.check_new(name)
        old = self._labels.pop(slot)
        del self._slot_of[old.id]
        if old.kind == "mover":
            self.movers.remove(slot)
        self.add(name, kind, xy, slot)

    def haunt(self, slot: int) -> None:
        """The label vanished but may still hold its object."""
        self._labels[slot] = self._labels[slot]._replace(ghost=True)
        self._shelf[slot] = False
        self.ghosts.append(slot)

    def remove(self, slot: int) -> None:
        """The label is gone; nothing may refer to its slot."""
        label = self._labels.pop(slot)
        del self._slot_of[label.id]
        self._shelf[slot] = False
        if label.ghost:
            self.ghosts.remove(slot)
        elif label.kind == "mover":
            self.movers.remove(slot)
        heapq.heappush(self._free, slot)

    def copy(self) -> Labels:
        """An independent copy."""
        twin = Labels.__new__(Labels)
        twin._slot_of, twin._labels, twin._free = dict(self._slot_of), dict(self._labels), list(self._free)
        twin.n_slots, twin.movers, twin.ghosts = self.n_slots, list(self.movers), list(self.ghosts)
        twin._shelf = self._shelf.copy()
        return twin

    def to_json(self) -> dict[str, Any]:
        """Plain JSON types, in order of appearance."""
        return {
            "slots": self.n_slots,
            "labels": [[s, n.id, n.kind, n.xy[0], n.xy[1]] for s, n in self._labels.items()],
            "movers": self.movers,
            "ghosts": self.ghosts,
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Labels:
        """What ``to_json`` wrote."""
        labels = cls()
        for slot, name, kind, x, y in data["labels"]:
            labels.add(name, kind, (x, y), slot)
        labels.n_slots = data["slots"]
        labels._shelf = np.concatenate([labels._shelf, np.zeros(labels.n_slots + 2, np.bool_)])
        labels._free = sorted(set(range(1, labels.n_slots)) - set(labels._labels))
        for slot in data["ghosts"]:
            labels.haunt(slot)
        labels.movers = list(data["movers"])
        return labels


def starting_labels(specs: tuple[LabelSpec, ...]) -> Labels:
    """The labels that exist before the first event. ValueError on a duplicate id."""
    labels = Labels()
    for spec in specs:
        labels.add(spec.id, spec.kind, spec.xy)
    return labels
