"""The hypotheses before the first event: known, a weighted list, or uniform."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from tms_server.placement.labels import OUT_SLOT, Labels
from tms_server.placement.objects import ObjectTable
from tms_server.placement.specs import Initial
from tms_server.placement.state import Array, Hypotheses

#: A uniform start with more placements than this is sampled if there is a budget, and refused if there is none.
MOST = 5_000_000


def starting_hypotheses(
    initial: Initial, objects: ObjectTable, labels: Labels, budget: int | None
) -> tuple[Hypotheses, bool]:
    """The hypotheses of a start, and whether they are all of them (a huge uniform start is sampled).

    Raises:
        ValueError: an unknown object or label, two objects at an exclusive label, weights that are not positive, fewer
            objects than exclusive labels, or a uniform start too large to be exact.
    """
    kind = initial.get("type")
    if kind == "known":
        return Hypotheses.certain(_placement(initial.get("placement", {}), objects, labels)), True
    if kind == "list":
        listed = initial["hypotheses"]
        weights = np.array([h["p"] for h in listed], np.float64)
        if not weights.size or not (weights > 0.0).all() or not np.isfinite(weights).all():
            raise ValueError("the weights of a list of hypotheses must be positive")
        slots = np.array([_placement(h["placement"], objects, labels) for h in listed], np.int32)
        return _weighted(slots, weights), True
    if kind == "uniform":
        return _uniform(objects, labels, budget)
    raise ValueError(f"unknown initial type {kind!r}")


def _placement(placement: Mapping[str, str], objects: ObjectTable, labels: Labels) -> Array:
    slots = np.full(len(objects), OUT_SLOT, np.int32)
    taken: set[int] = set()
    for name, label in placement.items():
        if name not in objects.index:
            raise ValueError(f"initial placement: unknown object {name!r}")
        try:
            slot = labels.slot(label)
        except KeyError:
            raise ValueError(f"initial placement: unknown label {label!r}") from None
        if slot != OUT_SLOT and labels[slot].kind != "mover":
            if slot in taken:
                raise ValueError(f"initial placement: two objects at {label!r}")
            taken.add(slot)
        slots[objects.index[name]] = slot
    return slots


def _weighted(slots: Array, weights: Array) -> Hypotheses:
    """Hypotheses from whole placements [H, N] and their weights; equal ones are merged."""
    n = slots.shape[1]
    belief = Hypotheses(slots, weights, np.arange(n, dtype=np.int32), np.full(n, -1, np.int32))
    belief.settle(belief.everything(), merge=True)
    return belief


def _uniform(objects: ObjectTable, labels: Labels, budget: int | None) -> tuple[Hypotheses, bool]:
    shelf = [slot for slot, label in labels if label.kind != "mover"]
    elsewhere = labels.movers or [OUT_SLOT]
    n, e = len(objects), len(shelf)
    if n < e:
        raise ValueError(f"a uniform start needs at least as many objects as exclusive labels ({n} < {e})")
    count = math.perm(n, e) * len(elsewhere) ** (n - e)
    if count <= MOST:
        slots = np.array(list(_all(n, shelf, elsewhere)), np.int32).reshape(-1, n)
        return _weighted(slots, np.ones(len(slots))), True
    if budget is None:
        raise ValueError(f"a uniform start of {count:.3g} placements cannot be exact (most: {MOST})")
    # Draws of the start are fixed: there is no event to name them.
    rng = np.random.Generator(np.random.Philox(key=0))
    slots = np.array(elsewhere, np.int32)[rng.integers(len(elsewhere), size=(budget, n))]
    for row in slots:
        row[rng.permutation(n)[:e]] = shelf
    return _weighted(slots, np.ones(budget)), False


def _all(n: int, shelf: list[int], elsewhere: list[int]) -> Any:
    for holders in itertools.permutations(range(n), len(shelf)):
        rest = [i for i in range(n) if i not in holders]
        for places in itertools.product(elsewhere, repeat=len(rest)):
            row = [0] * n
            for i, slot in zip((*holders, *rest), (*shelf, *places), strict=True):
                row[i] = slot
            yield row
