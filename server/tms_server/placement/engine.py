"""The belief engine: a weighted set of distinct placements, exact without a budget, resampled to it with one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from tms_schemas.events import Event, LabelAppeared, LabelMoved, Tick
from tms_server.placement import moves, readings, thinning, transfers
from tms_server.placement.initial import starting_hypotheses
from tms_server.placement.labels import Labels, starting_labels
from tms_server.placement.objects import ObjectTable
from tms_server.placement.parameters import Parameters
from tms_server.placement.resampling import Budget, light
from tms_server.placement.snapshot import pack, unpack
from tms_server.placement.specs import (
    DrawKey,
    Info,
    Initial,
    LabelSpec,
    LabelState,
    ObjectSpec,
)
from tms_server.placement.state import Array, Children, Hypotheses
from tms_server.placement.steps import Step, Steps, World

#: Marginals below this are left out.
NEGLIGIBLE = 1e-15

#: By type of event; subclasses with an envelope are as good.
_HANDLERS: Mapping[str, Callable[[World, Any], Steps]] = {
    "label_vanished": transfers.vanished,
    "mover_entered": moves.entered,
    "mover_left": moves.left,
    "tag_observed": readings.tag_observed,
    "tag_missed": readings.tag_missed,
    "handover": transfers.handover,
    "handover_possible": transfers.handover_possible,
    "mover_swap": moves.swapped,
    "transfer": moves.transferred,
    "load_change": readings.load_change,
    "correction": readings.correction,
}


class Engine:
    """Belief over placements (DESIGN 6; model: event format ``placement-events/1``).

    Args:
        objects: the tracked objects, unique ids and tags.
        labels: labels that exist before the first event.
        initial: where the objects are, as ``initial`` of a scenario file; objects not named are OUT.
        parameters: of the model.
        budget: most hypotheses to keep; None keeps all (exact).

    Raises:
        ValueError: objects, labels and initial placement do not fit together.
    """

    def __init__(
        self,
        objects: Sequence[ObjectSpec],
        labels: Sequence[LabelSpec],
        initial: Initial,
        parameters: Parameters,
        *,
        budget: int | None,
    ) -> None:
        if budget is not None and budget < 1:
            raise ValueError("the budget must be at least 1")
        self.budget = budget
        self._parameters = parameters
        self._objects = ObjectTable(objects, parameters)
        self._labels = starting_labels(tuple(labels))
        self._pies: list[dict[str, float]] | None = None
        # Lost over kept mass, bounded from above (rule 13); infinite once resampled.
        self._lost = 0.0
        self._belief, complete = starting_hypotheses(initial, self._objects, self._labels, budget)
        if not complete:
            self._lost = math.inf

    # -- events

    def apply(self, event: Event, key: DrawKey, *, p_jump: float | None = None) -> Info:
        """Fold one event.

        ``p_jump`` is for a ``label_appeared`` that nobody was there to cause, or to see: with this probability, in
        place of the parameter's, something came from OUT (and only from there).

        Raises:
            InvalidEvent: the event does not fit the labels; the state is unchanged.
        """
        if isinstance(event, LabelMoved):
            self._labels.move(self._labels.active(event.label), event.xy)
            return self._info(0.0, False, frozenset(), 0.0, False)
        if isinstance(event, Tick):
            return self._info(0.0, False, frozenset(), 0.0, False)
        self._pies = None
        world = World(self._parameters, self._objects, self._labels, self._belief)
        if isinstance(event, LabelAppeared):
            steps = transfers.appeared(world, event, p_jump)
        else:
            steps = _HANDLERS[event.type](world, event)
        budget = None if self.budget is None else Budget(self.budget, key)
        log_evidence, ceiling, contradiction = 0.0, 1.0, False
        touched: list[Array] = []
        try:
            step = next(steps)
            while True:
                mass = self._take(step, budget, touched)
                contradiction |= not mass > 0.0
                if mass > 0.0 and step.counts:
                    log_evidence += math.log(mass)
                    ceiling *= step.ceiling
                step = steps.send(mass > 0.0)
        except StopIteration:
            pass
        resampled = budget is not None and budget.exceeded
        if contradiction or resampled:
            self._lost = math.inf if self._lost > 0.0 or resampled else 0.0
            log_evidence = 0.0 if contradiction else log_evidence
        else:
            self._lost *= ceiling / math.exp(log_evidence) if self._lost > 0.0 else 1.0
        pruned = self._prune(touched) if touched or log_evidence != 0.0 else 0.0
        ids = self._objects.ids
        changed = frozenset(ids[i] for some in touched for i in some.tolist())
        return self._info(log_evidence, contradiction, changed, pruned, resampled)

    def _take(self, step: Step, budget: Budget | None, touched: list[Array]) -> float:
        """Apply one step; its total mass (0: impossible, nothing changed)."""
        if step.also is not None and step.also.size:
            touched.append(step.also)
        if step.children is None:
            return step.factor
        mass, moved = self._belief.settle(step.children, merge=step.merge, rows=step.rows, limit=budget)
        if moved.size:
            touched.append(moved)
        return mass

    def _prune(self, touched: list[Array]) -> float:
        """Drop the lightest hypotheses up to prune_eps (rule 13); the mass dropped."""
        eps = self._parameters.prune_eps
        if eps == 0.0:
            return 0.0
        keep, dropped = light(self._belief.w, eps)
        if keep.size == self._belief.w.size:
            return 0.0
        old = self._belief.everything()
        some = Children(*(a[keep] for a in old))
        _, moved = self._belief.settle(some, merge=False)
        touched.append(moved)
        self._lost = (self._lost + dropped) / (1.0 - dropped)
        return dropped

    def _info(
        self, log_evidence: float, contradiction: bool, changed: frozenset[str], pruned: float, resampled: bool
    ) -> Info:
        bound = 1.0 if math.isinf(self._lost) else self._lost / (1.0 + self._lost)
        return Info(log_evidence, contradiction, changed, len(self._belief), pruned, bound, resampled)

    # -- answers

    def marginals(self) -> dict[str, dict[str, float]]:
        """Object id -> label id -> probability, for every object; each sums to 1."""
        return {name: self.marginal(name) for name in self._objects.ids}

    def marginal(self, object_id: str) -> dict[str, float]:
        """Label id -> probability of one object; KeyError if it is unknown."""
        i = self._objects.index[object_id]
        slot = self._belief.pinned[i]
        if slot >= 0:
            return {self._labels.name(int(slot)): 1.0}
        if self._pies is None:
            self._pies = self._count_pies()
        return dict(self._pies[self._belief.col_of[i]])

    def _count_pies(self) -> list[dict[str, float]]:
        """The marginals of every object in play, in the order of its column."""
        ends, slots, shares = thinning.pies(self._belief.rows, self._belief.w, self._labels.n_slots, NEGLIGIBLE)
        names, share = self._labels.names(slots.tolist()), shares.tolist()
        pies, start = [], 0
        for end in ends.tolist():
            pies.append(dict(zip(names[start:end], share[start:end], strict=True)))
            start = end
        return pies

    @property
    def labels(self) -> Mapping[str, LabelState]:
        """Active labels and ghosts by id, in order of appearance."""
        return self._labels.states()

    @property
    def parameters(self) -> Parameters:
        """The parameters in force."""
        return self._parameters

    @property
    def objects(self) -> tuple[ObjectSpec, ...]:
        """The tracked objects, in order of registration."""
        return self._objects.specs

    @property
    def n_hypotheses(self) -> int:
        """Number of distinct placements kept."""
        return len(self._belief)

    def entropy_bits(self) -> float:
        """Entropy of the belief over whole placements, in bits."""
        w = self._belief.w
        return float(-(w * np.log2(w)).sum())

    def hypotheses(self) -> Iterator[tuple[float, dict[str, str]]]:
        """Every placement with its probability, the most probable first."""
        for h in np.argsort(-self._belief.w, kind="stable"):
            yield float(self._belief.w[h]), self._placement(int(h))

    def map_placement(self) -> tuple[float, dict[str, str]]:
        """The most probable placement and its probability."""
        h = int(self._belief.w.argmax())
        return float(self._belief.w[h]), self._placement(h)

    def _placement(self, h: int) -> dict[str, str]:
        slots = self._belief.pinned.copy()
        slots[self._belief.cols] = self._belief.rows[h]
        return {name: self._labels.name(int(s)) for name, s in zip(self._objects.ids, slots, strict=True)}

    # -- the registry

    def add_object(self, spec: ObjectSpec, places: Mapping[str, float] | None = None) -> None:
        """Track one more object: at OUT, or at active labels with the given prior probabilities and at OUT otherwise.

        Under hypotheses in which an exclusive label is occupied, its share stays at OUT.

        Raises:
            ValueError: the id or tag is taken, or the probabilities sum to more than 1.
            InvalidEvent: a label is not active.
        """
        slots = {self._labels.active(name): p for name, p in (places or {}).items()}
        if sum(slots.values()) > 1.0 + 1e-12:
            raise ValueError("the probabilities of the places sum to more than 1")
        objects = ObjectTable((*self._objects.specs, spec), self._parameters)
        exclusive = [slot for slot in slots if self._labels[slot].kind != "mover"]
        self._belief = self._belief.joined(slots, exclusive)
        self._objects, self._pies = objects, None

    def remove_object(self, object_id: str) -> None:
        """Forget an object: the belief is marginalised over it. KeyError if it is unknown."""
        i = self._objects.index[object_id]
        specs = [s for s in self._objects.specs if s.id != object_id]
        b, self._pies = self._belief, None
        keep = b.cols != i
        cols = b.cols[keep] - (b.cols[keep] > i).astype(np.int32)
        rows = np.ascontiguousarray(b.rows[:, keep])
        self._objects = ObjectTable(specs, self._parameters)
        self._belief = Hypotheses(rows, b.w, cols, np.delete(b.pinned, i))
        self._belief.settle(self._belief.everything(), merge=True)

    def change_object(self, spec: ObjectSpec) -> None:
        """New weight, size, tag or read rate of a known object, from now on. KeyError if it is unknown."""
        specs = list(self._objects.specs)
        specs[self._objects.index[spec.id]] = spec
        self._objects = ObjectTable(specs, self._parameters)

    def set_parameters(self, parameters: Parameters) -> None:
        """Other parameters from now on."""
        self._objects = ObjectTable(self._objects.specs, parameters)
        self._parameters = parameters

    # -- keeping

    def copy(self) -> Engine:
        """An independent engine in the same state; cheap, the hypotheses are shared until one of them changes."""
        twin = Engine.__new__(Engine)
        twin.budget, twin._parameters, twin._objects = self.budget, self._parameters, self._objects
        twin._labels, twin._belief, twin._lost = self._labels.copy(), self._belief.copy(), self._lost
        twin._pies = self._pies
        return twin

    def to_bytes(self) -> bytes:
        """The whole state: portable, versioned, checked. Folding on after ``from_bytes`` is bit-identical."""
        header = {
            "objects": self._objects.to_json(),
            "parameters": self._parameters.to_dict(),
            "labels": self._labels.to_json(),
            "budget": self.budget,
            "lost": None if math.isinf(self._lost) else self._lost,
        }
        b = self._belief
        return pack("engine", header, {"rows": b.rows, "w": b.w, "cols": b.cols, "pinned": b.pinned})

    @classmethod
    def from_bytes(cls, data: bytes) -> Engine:
        """The engine that ``to_bytes`` wrote. ValueError if the bytes are damaged or of another version."""
        header, arrays = unpack("engine", data)
        engine = cls.__new__(cls)
        engine.budget, engine._pies = header["budget"], None
        engine._parameters = Parameters.of(header["parameters"])
        engine._objects = ObjectTable([ObjectSpec(**o) for o in header["objects"]], engine._parameters)
        engine._labels = Labels.from_json(header["labels"])
        engine._lost = math.inf if header["lost"] is None else header["lost"]
        engine._belief = Hypotheses(arrays["rows"], arrays["w"], arrays["cols"], arrays["pinned"])
        return engine
