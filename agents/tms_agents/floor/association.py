"""Which cluster is whose foot: several hypotheses side by side, so that a crossing is decided when it is over."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.adopting import BLANK, adopt_from, chosen, complete
from tms_agents.floor.assignment import reassign, solve, work
from tms_agents.floor.bodies import begin, predict
from tms_agents.floor.build import agree
from tms_agents.floor.hypotheses import ALL, FEET, copy, exchange, first_like, same_places, settle
from tms_agents.floor.identity import christen, renamed, unite
from tms_agents.floor.left_feet import put
from tms_agents.floor.likelihood import UNLIKELY, feet
from tms_agents.floor.masks import joined
from tms_agents.floor.nobodys import goes_on, known, nobodys, spanned
from tms_agents.floor.settings import Polygon
from tms_agents.floor.shine import expected, scatter
from tms_agents.floor.state import BODY, empty, pack, unpack

Array = NDArray[np.float64]

#: Hypotheses kept; how much worse (negative log likelihood) one may be than the best, and its parent's.
_KEPT, _WORSE, _BRANCH = 14, 18.0, 10.0
#: Of a scan so many bodies that took the same feet are kept, to be copied.
_POOL = 256
#: Who began so near (m) the end of a robot is a part of it.
_BEGAN_M = 0.1
#: What is known of who has a name; what belongs to a name, not to the body that has it.
OWN = ("own", "own_n", "own_pace", "own_pace_n", "own_girth", "own_girth_n", "own_sole", "own_sole_n")
NAMED = ("label", "first", *OWN, "told_x", "told_y", "told_at")


@njit(cache=True)
def _advance(
    hypotheses: Any,
    raw: NDArray[np.int64],
    spare: Any,
    beliefs: Array,
    spare_beliefs: Array,
    scores: Array,
    count: int,
    clusters: Any,
    of: NDArray[np.int64],
    marks: Array,
    scattered: Array,
    blank: Any,
    pool: Any,
    prints: Any,
    t: float,
    sight: Any,
    seats: Any,
    taken: NDArray[np.bool_],
    nobodys_at: Array,
    spare_nobodys_at: Array,
) -> int:
    """One scan for all ``hypotheses`` (kept, n) of bodies with ``scores`` (kept,): how many there are now in ``spare``.

    The best is the first. ``raw`` (kept, n, fields) are the same ``hypotheses`` as integers, ``pool`` is scratch for
    bodies. ``taken`` (m,) becomes which clusters are somebody's in the best. ``nobodys_at`` (kept, p) is when each
    print was last seen to be nobody's who is believed.
    """
    n, m = hypotheses.shape[1], clusters.size
    most = count * (m + 1)
    child_score, child_parent, child_columns = np.empty(most), np.empty(most, np.int64), np.full((most, m), -1)
    first, alike, top = np.empty((count, n), np.int64), np.empty((count, n), np.int64), 0
    for h in range(count):
        predict(hypotheses[h], t)
        for b in range(n):
            if hypotheses[h, b].used:
                top = max(top, b + 1 if hypotheses[h, b].confirmed else 0)
                g = first_like(raw, ALL, h, b)
                first[h, b] = g
                alike[h, b] = alike[g, b] if g < h else first_like(raw, FEET, h, b)
    children = _propose(
        hypotheses,
        alike,
        top,
        scores,
        clusters,
        of,
        marks,
        prints,
        t,
        nobodys_at,
        child_score,
        child_parent,
        child_columns,
    )
    rows, other_of, scratch = np.empty(n, np.int64), np.empty(n, np.int64), np.empty((2, n))
    owned, free = np.zeros((hypotheses.shape[0], max(m, 1)), np.bool_), np.ones(m, np.bool_)
    seen, misses, last = np.empty((pool.size, 4), np.int64), np.empty(pool.size), np.full(n, -1)
    order = np.argsort(child_score[:children])
    kept, pooled = 0, 0
    least = child_score[order[0]]
    for o in order:
        if kept == hypotheses.shape[0] or child_score[o] > least + _WORSE:
            break
        bodies, parent = spare[kept], child_parent[o]
        copy(hypotheses[parent], beliefs[parent], bodies, spare_beliefs[kept], False)
        k = chosen(hypotheses[parent], 1, rows)
        free[:] = True
        pooled, unseen = adopt_from(
            hypotheses[parent],
            first[parent],
            bodies,
            rows[:k],
            child_columns[o],
            clusters,
            of,
            marks,
            free,
            blank,
            prints,
            t,
            sight,
            seats,
            pool,
            seen,
            misses,
            last,
            pooled,
        )
        spare_nobodys_at[kept] = nobodys_at[parent]
        for i in range(m):
            if free[i] and of[i] >= 0:
                spare_nobodys_at[kept, of[i]] = t
        complete(bodies, clusters, of, marks, free, blank, prints, t, sight)
        score = child_score[o] - least + unseen
        known_already = False
        for j in range(kept):
            if same_places(spare[j], bodies, top, other_of):
                worse = score - scores[j]
                unite(spare[j], spare_beliefs[j], bodies, spare_beliefs[kept], other_of, worse, scattered, scratch)
                known_already = True
                break
        if known_already:
            continue
        for i in range(m):
            owned[kept, i] = not free[i]
        scores[kept] = score
        kept += 1
    best = int(np.argmin(scores[:kept]))
    if best:
        exchange(spare[0], spare_beliefs[0], spare[best], spare_beliefs[best], hypotheses[0], beliefs[0])
        for p in range(spare_nobodys_at.shape[1]):
            spare_nobodys_at[0, p], spare_nobodys_at[best, p] = spare_nobodys_at[best, p], spare_nobodys_at[0, p]
        scores[0], scores[best] = scores[best], scores[0]
    scores[:kept] -= scores[0]
    for i in range(m):
        taken[i] = owned[best, i]
    return kept


@njit(cache=True)
def _propose(
    hypotheses: Any,
    alike: NDArray[np.int64],
    top: int,
    scores: Array,
    clusters: Any,
    of: NDArray[np.int64],
    marks: Array,
    prints: Any,
    t: float,
    nobodys_at: Array,
    child_score: Array,
    child_parent: NDArray[np.int64],
    child_columns: NDArray[np.int64],
) -> int:
    """How each hypothesis may go on: the best assignment, and the best in which one cluster is not who it is there.

    ``alike`` (count, n) is in which hypothesis each body was the same first, for `feet`: most people are the same in
    all. All who are believed are among the first ``top``. Fills what children there are, their score, parent and
    columns; how many.
    """
    count, n, m = alike.shape[0], hypotheses.shape[1], clusters.size
    rows = np.empty(n, np.int64)
    everything, columns, other = np.ones(m, np.bool_), np.empty(m, np.int64), np.empty(m, np.int64)
    told = np.empty((count, top, m, 2))
    table, solved = np.empty(m * (2 * top + m)), work(m, 2 * top + m)
    spans = np.empty(m)
    spanned(clusters, spans)
    children, least = 0, np.inf
    for h in range(count):
        bodies = hypotheses[h]
        k = chosen(bodies, 1, rows)
        if m == 0 or k == 0:
            child_score[children], child_parent[children] = scores[h], h
            children += 1
            continue
        cost = table[: m * (2 * k + m)].reshape(m, 2 * k + m)
        for column in range(k):
            row = rows[column]
            like = alike[h, row]
            if like == h:
                feet(clusters, of, marks, everything, prints, bodies, row, t, told[h, row])
            for i in range(m):
                cost[i, 2 * column], cost[i, 2 * column + 1] = told[like, row, i, 0], told[like, row, i, 1]
        nobodys(clusters, of, prints, bodies, rows[:k], spans, t, cost[:, 2 * k :])
        known(clusters, bodies, t, cost[:, 2 * k :])
        goes_on(clusters, of, prints, bodies, rows[:k], nobodys_at[h], t, cost[:, 2 * k :])
        best = solve(cost, 2 * k, UNLIKELY, columns, solved)
        child_score[children], child_parent[children] = scores[h] + best, h
        least = min(least, scores[h] + best)
        # What is worse is given up anyway.
        most = min(_BRANCH, least + _WORSE - scores[h] - best)
        child_columns[children] = columns
        children += 1
        for i in range(m):
            if columns[i] >= 2 * k:
                continue
            total = reassign(cost, columns, i, columns[i] // 2 * 2, 1.01 * most, other, solved)
            if total - best < most:
                child_score[children], child_parent[children] = scores[h] + total, h
                child_columns[children] = other
                children += 1
    return children


class Association:
    """The hypotheses about who is where; the best is ``bodies`` (``most``,) of `state.BODY`; so many ``prints``.

    On ``seats`` people lift their feet.
    """

    def __init__(self, most: int, prints: int, seats: Sequence[Polygon] = ()) -> None:
        self.seats = joined(seats)
        self._hypotheses, self._spare = empty(BODY, (_KEPT, most)), empty(BODY, (_KEPT, most))
        self._pool = empty(BODY, _POOL)
        # All fields are as long as an integer: what is the same to the last bit is found by these.
        self._raw = self._hypotheses.view(np.int64).reshape(_KEPT, most, -1)
        self._spare_raw = self._spare.view(np.int64).reshape(_KEPT, most, -1)
        self._before, self._decided = np.zeros_like(self._raw[:1]), np.zeros(most, np.bool_)
        self._beliefs, self._spare_beliefs = np.zeros((_KEPT, most, most)), np.zeros((_KEPT, most, most))
        self._beliefs[:] = np.eye(most)
        self._nobodys_at, self._spare_nobodys_at = np.full((_KEPT, prints), -1e9), np.full((_KEPT, prints), -1e9)
        self._names = np.zeros(most, np.int64)
        self._scores = np.zeros(_KEPT)
        self._count = 1
        self.scattered = expected()

    @property
    def bodies(self) -> Any:
        """Those of the best hypothesis, until the next scan."""
        return self._hypotheses[0]

    def step(
        self, clusters: Any, of: NDArray[np.int64], marks: Array, prints: Any, t: float, sight: Any
    ) -> NDArray[np.bool_]:
        """Take in the clusters (m,) of a scan, their prints ``of`` (m,) and ``marks`` (m, 4), `View.sight`: whose."""
        taken = np.zeros(clusters.size, np.bool_)
        self._count = _advance(
            self._hypotheses,
            self._raw,
            self._spare,
            self._beliefs,
            self._spare_beliefs,
            self._scores,
            self._count,
            clusters,
            of,
            marks,
            self.scattered,
            BLANK,
            self._pool,
            prints,
            t,
            sight,
            self.seats,
            taken,
            self._nobodys_at,
            self._spare_nobodys_at,
        )
        self._hypotheses, self._spare = self._spare, self._hypotheses
        self._raw, self._spare_raw = self._spare_raw, self._raw
        self._beliefs, self._spare_beliefs = self._spare_beliefs, self._beliefs
        self._nobodys_at, self._spare_nobodys_at = self._spare_nobodys_at, self._nobodys_at
        scatter(self.bodies, clusters, of, marks, t, self.scattered)
        return taken

    def agree(self, shoes: Array) -> None:
        """All show one kind of feet, once it is known which; ``shoes`` (2,) is what `build.count_shoes` learns."""
        agree(self._hypotheses[: self._count], shoes)

    def mark(self) -> None:
        """From now on until `settle` what is known of the best hypothesis may change."""
        self._before[:] = self._raw[:1]
        self._decided[:] = False

    def decide(self, *indices: int) -> None:
        """What is found of these movers is so: hypotheses in which they are others count no more."""
        self._decided[list(indices)] = True

    def decide_changed(self) -> None:
        """The same of everybody who is another one since `mark`."""
        self._decided |= (self._before[0] != self._raw[0])[:, FEET].any(axis=1)

    def settle(self) -> None:
        """What has changed since `mark` is so in all hypotheses in which it was as in the best."""
        if self._count > 1:
            self._count = settle(
                self._hypotheses,
                self._raw,
                self._before,
                self._decided,
                self._scores,
                self._beliefs,
                self._nobodys_at,
                self._count,
            )

    def named(self, index: int, lost: tuple[float, float] | None = None) -> None:
        """The mover at ``index`` has a name of its own, or that of one who was ``lost`` at (x, y) m."""
        self.decide(index)
        for bodies, belief in zip(self._hypotheses[: self._count], self._beliefs[: self._count], strict=True):
            christen(bodies, belief, index, *((np.nan, np.nan) if lost is None else lost))

    def rename(self, t: float) -> None:
        """Give people their own names back."""
        if not renamed(self.bodies, self._beliefs[0], t, self.scattered, self._names):
            return
        changed = np.flatnonzero(self._names != np.arange(self._names.size))
        source = self._names[changed]
        for bodies, belief in zip(self._hypotheses[: self._count], self._beliefs[: self._count], strict=True):
            for field in NAMED:
                bodies[field][changed] = bodies[field][source]
            belief[:, changed] = belief[:, source]

    @property
    def hypotheses(self) -> Any:
        """All that are kept, (h, ``most``) of `state.BODY`, the best first."""
        return self._hypotheses[: self._count]

    def robot(self, index: int, footprint: Any, number: int, t: float) -> int:
        """The mover at ``index`` (-1: a new one) is the robot of the ``footprint`` (`state.FOOTPRINT`) of this number.

        Which it is; -1 where there is no room for a new one.
        """
        everywhere = self.hypotheses
        # Whoever began there and is not believed yet is this robot.
        away = np.hypot(everywhere["x"] - footprint["x"], everywhere["y"] - footprint["y"])
        everywhere["used"][(everywhere["confirmed"] == 0) & (away < footprint["a"] + _BEGAN_M)] = 0
        if index < 0:
            index = self._free()
            if index < 0:
                return -1
            for bodies in everywhere:
                begin(bodies[index], BLANK[0], -1, t)
            new = everywhere[:, index]
            for name in ("x0", "y0", "first"):
                new[name] = footprint[name]
            for name in ("hits", "looks", "due"):
                new[name] = footprint["hits"]
        everywhere["footprint"][:, index] = number
        return index

    def stand(self, prints: Any, i: int, t: float) -> int:
        """Somebody new stands on the print i: which mover that is; -1 where there is no room for one."""
        index = self._free()
        if index >= 0:
            put(self.hypotheses, index, prints, i, t)
            # Nobody was there in any hypothesis: what is found of the new one is so in all.
            self._before[0, index] = self._raw[0, index]
        return index

    def _free(self) -> int:
        """The first that is nobody in any hypothesis; -1: none."""
        free = np.flatnonzero(~self.hypotheses["used"].any(axis=0))
        return int(free[0]) if free.size else -1

    def forget(self, index: int) -> None:
        """The mover at ``index`` has gone, whatever hypothesis holds."""
        self._hypotheses["used"][: self._count, index] = 0

    def save(self) -> dict[str, Any]:
        """JSON values: all hypotheses, and what is known of brightness."""
        n = self._count
        return {
            "count": n,
            "bodies": pack(self._hypotheses[:n]),
            "beliefs": pack(self._beliefs[:n]),
            "scores": pack(self._scores[:n]),
            "nobodys_at": pack(self._nobodys_at[:n]),
            "scattered": pack(self.scattered),
        }

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        n = int(saved["count"])
        if not 1 <= n <= _KEPT:
            raise ValueError("the saved state of the floor estimator has an impossible number of hypotheses")
        self._count = n
        for name, array in (
            ("bodies", self._hypotheses),
            ("beliefs", self._beliefs),
            ("scores", self._scores),
            ("nobodys_at", self._nobodys_at),
        ):
            array[:n] = unpack(saved[name], array[:n])
        self.scattered[:] = unpack(saved["scattered"], self.scattered)
