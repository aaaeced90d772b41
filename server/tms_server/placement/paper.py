"""The particle filter of the system's first paper, as written; its weaknesses are documented, not repaired.

Steps and equation numbers are those of the paper's section 3.2; what it leaves open is decided in docs/placement.md
(A1 to A9).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from tms_schemas.events import (
    Event,
    Handover,
    LabelAppeared,
    LabelMoved,
    LabelVanished,
    MoverEntered,
    MoverLeft,
    TagObserved,
    Tick,
    Transfer,
)
from tms_server.placement.initial import starting_hypotheses
from tms_server.placement.labels import OUT_SLOT, Labels, starting_labels
from tms_server.placement.objects import ObjectTable
from tms_server.placement.parameters import Parameters
from tms_server.placement.resampling import generator
from tms_server.placement.snapshot import pack, unpack
from tms_server.placement.specs import (
    DrawKey,
    Info,
    Initial,
    InvalidEvent,
    LabelSpec,
    LabelState,
    ObjectSpec,
)
from tms_server.placement.state import Array

#: A wrong placement of one object should be down to this after the cycles of the event that contradicts it.
_SETTLED = 0.02
_NOTHING_CHANGES = frozenset[str]()


class PaperFilter:
    """R individuals, one placement each; every sensor cycle moves, weighs and redraws all of them.

    Args:
        individuals: R.
        share: J, the share drawn from the present individuals; the rest is generated at random.
        cycles: sensor cycles per event; None runs as many after a new report as it takes to act on it (see
            docs/placement.md, A2), and one after any other event.
        seed: of the first individuals; the events bring their own keys.
    """

    def __init__(
        self,
        objects: Sequence[ObjectSpec],
        labels: Sequence[LabelSpec],
        initial: Initial,
        parameters: Parameters,
        *,
        individuals: int = 10_000,
        share: float = 0.99,
        cycles: int | None = None,
        seed: int = 0,
    ) -> None:
        if individuals < 1 or not 0.0 < share <= 1.0:
            raise ValueError("the paper's filter needs at least one individual and 0 < J <= 1")
        self._parameters = parameters
        self._objects = ObjectTable(objects, parameters)
        self._labels = starting_labels(tuple(labels))
        self._share, self.cycles = share, cycles
        rng = generator(DrawKey(seed, "first individuals", 0))
        start, _ = starting_hypotheses(initial, self._objects, self._labels, individuals)
        chosen = rng.choice(len(start), individuals, p=start.w)
        self._x = np.repeat(start.pinned[None, :], individuals, axis=0)
        self._x[:, start.cols] = start.rows[chosen]
        # The reports: slot -> object. Those of a known start are the tags that were read when things were put in.
        self._reports: dict[int, int] = {}
        if len(start) == 1:
            self._reports = {
                int(slot): i
                for i, slot in enumerate(start.pinned)
                if slot != OUT_SLOT
                and self._labels[int(slot)].kind in ("cabinet", "robot", "table")
                and self._objects.tagged[i]
            }
        self._p: Array | None = None

    def apply(self, event: Event, key: DrawKey, *, p_jump: float | None = None) -> Info:
        """One event: step 2 for a change of labels, then steps 3 and 4 for the cycles of the event.

        What the paper's sensors do not report (weights, sizes, missed reads, zones, possible hand-overs, swaps) is
        ignored. ``p_jump`` has no meaning here.

        Raises:
            InvalidEvent: the event does not fit the labels; the state is unchanged.
        """
        del p_jump
        rng = generator(key)
        if isinstance(event, Tick):
            self._cycle(event.n, {}, rng)
            return self._info()
        before = dict(self._reports)
        extra: dict[int, int] = {}
        match event:
            case LabelAppeared():
                self._appeared(event, rng)
            case LabelVanished():
                self._vanished(event, rng)
            case LabelMoved():
                self._labels.move(self._labels.active(event.label), event.xy)
            case MoverEntered():
                self._labels.add(event.label, "mover", event.xy)
            case MoverLeft():
                slot = self._labels.mover(event.label)
                self._x[self._x == slot] = OUT_SLOT
                self._labels.remove(slot)
            case TagObserved(label=str(name)):
                slot = self._labels.active(name)
                if event.tag in self._objects.by_tag and self._labels[slot].kind != "mover":
                    self._reports[slot] = self._objects.by_tag[event.tag]
            case Handover():
                extra = self._handed(event, rng)
            case Transfer():
                self._transferred(event)
            case _:
                return self._info(idle=True)
        news = bool(extra) or any(before.get(slot) != obj for slot, obj in self._reports.items())
        self._cycle(self._cycles_after(news), extra, rng)
        return self._info()

    # -- step 2: transition

    def _appeared(self, event: LabelAppeared, rng: np.random.Generator) -> None:
        """(I): a mover near the label puts down one of the things he holds."""
        self._labels.check_new(event.label)
        source = None if event.source is None else self._labels.mover(event.source)
        movers = self._labels.movers if source is None else [source]
        slot_xy = event.xy
        holders = np.array(movers, np.int32)
        weights = self._nearness(movers, slot_xy)
        slot = self._labels.add(event.label, event.kind, event.xy)
        if holders.size:
            held = np.stack([(self._x == m).sum(axis=1) for m in holders], axis=1)  # [R, M]
            self._put(self._choose(weights * (held > 0), rng), holders, held, slot, rng)
        if event.tag is not None and event.tag in self._objects.by_tag:
            self._reports[slot] = self._objects.by_tag[event.tag]

    def _put(self, chosen: Array, holders: Array, held: Array, slot: int, rng: np.random.Generator) -> None:
        """In each individual, one (uniform) thing of the chosen holder goes to the slot; -1: nothing moves."""
        who = np.flatnonzero(chosen >= 0)
        giver = holders[chosen[who]]
        rank = (rng.random(who.size) * held[who, chosen[who]]).astype(np.int64)
        at_giver = self._x[who] == giver[:, None]
        obj = (np.cumsum(at_giver, axis=1) > rank[:, None]).argmax(axis=1)
        self._x[who, obj] = slot

    def _vanished(self, event: LabelVanished, rng: np.random.Generator) -> None:
        """(II): what was there went to a mover near the label."""
        slot = self._labels.exclusive(event.label)
        dest = None if event.dest is None else self._labels.mover(event.dest)
        movers = self._labels.movers if dest is None else [dest]
        individual, obj = np.nonzero(self._x == slot)
        if movers:
            weights = np.tile(self._nearness(movers, self._labels[slot].xy), (individual.size, 1))
            self._x[individual, obj] = np.array(movers, np.int32)[self._choose(weights, rng)]
        else:
            self._x[individual, obj] = OUT_SLOT
        self._reports.pop(slot, None)
        self._labels.remove(slot)

    def _handed(self, event: Handover, rng: np.random.Generator) -> dict[int, int]:
        """A notice: one thing of the giver goes to the taker; the tag counts in this event's fitness."""
        giver, taker = self._labels.mover(event.from_), self._labels.mover(event.to)
        held = (self._x == giver).sum(axis=1)[:, None]
        chosen = np.where(held[:, 0] > 0, 0, -1)
        self._put(chosen, np.array([giver], np.int32), held, taker, rng)
        obj = None if event.tag is None else self._objects.by_tag.get(event.tag)
        return {} if obj is None else {taker: obj}

    def _transferred(self, event: Transfer) -> None:
        """The robot says where it put the thing: the label has another name, place and kind."""
        labels = self._labels
        slot = labels.active(event.from_)
        if event.to == event.from_:
            raise InvalidEvent(f"label {event.to!r} cannot be transferred to itself")
        if event.to not in labels.states():
            kind = event.kind or labels[slot].kind
            if kind != "mover" and ((self._x == slot).sum(axis=1) > 1).any():
                raise InvalidEvent(f"label {event.to!r} cannot hold several objects")
            labels.rename(slot, event.to, kind, event.xy or labels[slot].xy)
            return
        to = labels.active(event.to)
        if labels[to].kind != "mover" and (self._x == to).any():
            raise InvalidEvent(f"label {event.to!r} is occupied")
        self._x[self._x == slot] = to
        if slot in self._reports:
            self._reports[to] = self._reports.pop(slot)
        labels.remove(slot)

    def _nearness(self, movers: list[int], xy: tuple[float, float]) -> Array:
        """The paper's "probability according to distance": a Gaussian of width sigma_m, scaled to a maximum of 1."""
        if not movers:
            return np.empty(0)
        at = np.array([self._labels[m].xy for m in movers], np.float64)
        d2 = ((at - np.asarray(xy, np.float64)) ** 2).sum(axis=1)
        # A floor keeps far movers choosable where no nearer one holds anything.
        nearness: Array = np.exp((d2.min() - d2) / (2.0 * self._parameters.sigma_m**2))
        return np.maximum(nearness, 1e-300)

    @staticmethod
    def _choose(weights: Array, rng: np.random.Generator) -> Array:
        """One column per row with probability proportional to the weights; -1 where all are 0."""
        edges = np.cumsum(weights, axis=1)
        total = edges[:, -1]
        chosen = (edges <= (rng.random(total.size) * total)[:, None]).sum(axis=1)
        return np.where(total > 0.0, np.minimum(chosen, weights.shape[1] - 1), -1)

    # -- steps 3 and 4: fitness and resampling

    def _cycles_after(self, news: bool) -> int:
        if self.cycles is not None:
            return self.cycles
        if not news:
            return 1
        wanted = math.ceil(max(len(self._reports), 1) * math.log(1.0 / _SETTLED))
        return min(wanted, max(len(self._x) // 20, 1))

    def _cycle(self, n: int, extra: Mapping[int, int], rng: np.random.Generator) -> None:
        """n times: f = C * (number of agreeing reports), draw R * J individuals, generate the others at random."""
        reports = [*self._reports.items(), *extra.items()]
        slots = np.array([s for s, _ in reports], np.int32)
        objects = np.array([o for _, o in reports], np.int64)
        r = len(self._x)
        drawn = round(r * self._share)
        for _ in range(n):
            fitness = (self._x[:, objects] == slots).sum(axis=1) if reports else np.ones(r)
            edges = np.cumsum(fitness, dtype=np.float64)
            if not edges[-1] > 0.0:  # 0/0 in the paper: everybody is as unfit as everybody else
                edges = np.arange(1.0, r + 1.0)
            picks = np.searchsorted(edges, rng.random(drawn) * edges[-1], side="right")
            self._x = np.concatenate([self._x[np.minimum(picks, r - 1)], self._random(r - drawn, rng)])
        self._p = None

    def _random(self, count: int, rng: np.random.Generator) -> Array:
        """Random placements: exclusive labels to distinct random objects, the rest to random movers."""
        n = len(self._objects)
        shelf = np.array([s for s, label in self._labels if label.kind != "mover"], np.int32)
        elsewhere = np.array(self._labels.movers or [OUT_SLOT], np.int32)
        x = elsewhere[rng.integers(elsewhere.size, size=(count, n))]
        places = min(shelf.size, n)
        for row in x:
            row[rng.permutation(n)[:places]] = rng.permutation(shelf)[:places]
        return x.astype(np.int32)

    # -- step 6: answers

    def marginals(self) -> dict[str, dict[str, float]]:
        """Object id -> label id -> share of the individuals, for every object."""
        return {name: self.marginal(name) for name in self._objects.ids}

    def marginal(self, object_id: str) -> dict[str, float]:
        """p_ij of one object; KeyError if it is unknown."""
        i = self._objects.index[object_id]
        if self._p is None:
            slots, n = self._labels.n_slots, len(self._objects)
            flat = np.bincount((self._x + np.arange(n, dtype=np.int32) * slots).ravel(), minlength=n * slots)
            self._p = flat.reshape(n, slots) / len(self._x)
        row = self._p[i]
        return {self._labels.name(int(s)): float(row[s]) for s in np.flatnonzero(row)}

    @property
    def labels(self) -> Mapping[str, LabelState]:
        """Active labels by id; this filter knows no ghosts."""
        return self._labels.states()

    def _info(self, *, idle: bool = False) -> Info:
        changed = _NOTHING_CHANGES if idle else frozenset(self._objects.ids)
        return Info(math.nan, False, changed, len(self._x), 0.0, 1.0, not idle)

    def to_bytes(self) -> bytes:
        """The whole state: portable, versioned, checked."""
        header = {
            "objects": self._objects.to_json(),
            "parameters": self._parameters.to_dict(),
            "labels": self._labels.to_json(),
            "reports": list(self._reports.items()),
            "share": self._share,
            "cycles": self.cycles,
        }
        return pack("paper", header, {"x": self._x})

    @classmethod
    def from_bytes(cls, data: bytes) -> PaperFilter:
        """The filter that ``to_bytes`` wrote. ValueError if the bytes are damaged or of another kind."""
        header, arrays = unpack("paper", data)
        self = cls.__new__(cls)
        self._parameters = Parameters.of(header["parameters"])
        self._objects = ObjectTable([ObjectSpec(**o) for o in header["objects"]], self._parameters)
        self._labels = Labels.from_json(header["labels"])
        self._reports = dict(header["reports"])
        self._share, self.cycles = header["share"], header["cycles"]
        self._x, self._p = arrays["x"], None
        return self
