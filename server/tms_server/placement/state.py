"""The weighted set of distinct hypotheses, and how the children of an event become the next one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from tms_server.placement import kernels, settling, thinning

Array = np.ndarray[Any, np.dtype[Any]]

#: Sweeps of calibration after thinning; more change little.
_SWEEPS = 6


class Children(NamedTuple):
    """Hypotheses after an event as (parent row, object moved or -1, where to, mass, hash); see ``kernels``."""

    parent: Array
    obj: Array
    to: Array
    mass: Array
    zob: Array


class Hypotheses:
    """Placements with weights. Only objects in play have a column; the others are pinned to one slot.

    ``rows`` int32 [H, K], ``w`` float64 [H] (sum 1), ``zob`` uint64 [H] (equal placements have equal hashes), ``cols``
    int32 [K] (object of each column, ascending), ``pinned`` int32 [N] (slot, -1 in play), ``col_of`` int32 [N].
    """

    def __init__(self, rows: Array, w: Array, cols: Array, pinned: Array) -> None:
        self.rows, self.w, self.cols, self.pinned = rows, w, cols, pinned
        self.col_of = np.full(pinned.size, -1, np.int32)
        self.col_of[cols] = np.arange(cols.size, dtype=np.int32)
        self.zob: Array = kernels.hashes(rows, cols)

    @classmethod
    def certain(cls, pinned: Array) -> Hypotheses:
        """One hypothesis: every object is where ``pinned`` says."""
        return cls(np.empty((1, 0), np.int32), np.ones(1), np.empty(0, np.int32), pinned)

    def copy(self) -> Hypotheses:
        """Independent of this one; arrays that are never written in place are shared."""
        twin = Hypotheses.__new__(Hypotheses)
        twin.rows, twin.w, twin.zob, twin.cols = self.rows, self.w, self.zob, self.cols
        twin.pinned, twin.col_of = self.pinned.copy(), self.col_of.copy()
        return twin

    def __len__(self) -> int:
        return int(self.w.size)

    def column(self, obj: int) -> Array:
        """The slot of one object under every hypothesis, [H]."""
        k = self.col_of[obj]
        return self.rows[:, k] if k >= 0 else np.full(self.w.size, self.pinned[obj], np.int32)

    def holds(self, slot: int) -> bool:
        """Whether any hypothesis has an object there."""
        return bool((self.pinned == slot).any() or (self.rows == slot).any())

    def settle(
        self,
        children: Children,
        *,
        merge: bool,
        rows: Array | None = None,
        limit: Callable[[Array], tuple[Array, Array] | None] | None = None,
    ) -> tuple[float, Array]:
        """Make the children the new set.

        ``rows``: what their parents index, if not the present rows. ``limit(weights)`` may answer which of the
        (normalised) children to keep, and their weights.

        Returns (total mass, objects that were in play or moved). A total of 0 leaves everything as it is.
        """
        rows = self.rows if rows is None else rows
        total, w, zob, new, cols, touched = settling.settle(rows, self.cols, self.col_of, self.pinned, *children, merge)
        if not total > 0.0:
            return 0.0, touched
        self.rows, self.cols, self.w, self.zob = new, cols, w, zob
        chosen = None if limit is None else limit(w)
        if chosen is not None:
            self._thin(*chosen)
        return total, touched

    def _thin(self, keep: Array, w: Array) -> None:
        """Keep some rows with new weights, calibrated to the marginals of all rows."""
        target = thinning.marginals(self.rows, self.w, int(self.rows.max(initial=0)) + 1)
        rows = self.rows[keep]
        if rows.shape[1]:
            thinning.calibrate(rows, w, target, _SWEEPS)
        still = np.full(keep.size, -1, np.int32)
        self.w, self.zob = w, self.zob[keep]
        self.rows, self.cols, _ = settling.build(
            rows, self.cols, self.col_of, self.pinned, np.arange(keep.size, dtype=np.int32), still, still
        )

    def unpin(self, objects: Array) -> None:
        """Give certain objects a column, although they do not vary yet."""
        order = np.concatenate([self.cols, objects.astype(np.int32)])
        values = np.broadcast_to(self.pinned[objects], (self.w.size, objects.size))
        rows = np.concatenate([self.rows, values.astype(np.int32)], axis=1)
        by_object = np.argsort(order, kind="stable")
        # The hash of the new columns is the same for every row, so that hashes stay comparable without it.
        self.cols, self.rows = order[by_object], np.ascontiguousarray(rows[:, by_object])
        self.pinned[objects] = -1
        self.col_of[self.cols] = np.arange(self.cols.size, dtype=np.int32)

    def joined(self, places: Mapping[int, float], exclusive: Sequence[int]) -> Hypotheses:
        """This belief with one more object, the last: independently at each slot of ``places`` with its probability.

        The rest of the probability is OUT (slot 0), and so is the share of an ``exclusive`` slot that is occupied.
        """
        obj, still = self.pinned.size, np.arange(self.w.size)
        parents, to, masses, outside = [], [], [], np.ones(self.w.size)
        for slot, p in places.items():
            free = np.full(self.w.size, p)
            if slot in exclusive:
                free[(self.rows == slot).any(axis=1) | (self.pinned == slot).any()] = 0.0
            outside -= free
            there = np.flatnonzero(free)
            parents.append(there)
            to.append(np.full(there.size, slot, np.int32))
            masses.append(self.w[there] * free[there])
        out = still[outside > 0.0]
        parent = np.concatenate([out, *parents])
        column = np.concatenate([np.zeros(out.size, np.int32), *to])
        w = np.concatenate([self.w[out] * outside[out], *masses])
        if (column == column[0]).all():
            return Hypotheses(self.rows, self.w, self.cols, np.append(self.pinned, column[0]))
        rows = np.column_stack([self.rows[parent], column]).astype(np.int32)
        cols, pinned = np.append(self.cols, np.int32(obj)), np.append(self.pinned, np.int32(-1))
        return Hypotheses(np.ascontiguousarray(rows), w / w.sum(), cols, pinned)

    def everything(self) -> Children:
        """The present set as children in which nothing moved."""
        n = self.w.size
        still = np.full(n, -1, np.int32)
        return Children(np.arange(n, dtype=np.int32), still, still.copy(), self.w.copy(), self.zob.copy())
