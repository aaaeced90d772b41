"""Which cluster is whose foot: several hypotheses side by side, so that a crossing is decided when it is over."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.adopting import BLANK, adopt, chosen
from tms_agents.floor.assignment import assign
from tms_agents.floor.bodies import predict
from tms_agents.floor.build import agree
from tms_agents.floor.identity import christen, renamed, unite
from tms_agents.floor.likelihood import UNLIKELY, costs, known
from tms_agents.floor.shine import expected, scatter
from tms_agents.floor.state import BODY, empty, pack, unpack

Array = NDArray[np.float64]

#: Hypotheses kept; how much worse (negative log likelihood) one may be than the best, and its parent's; new ones.
_KEPT, _WORSE, _BRANCH, _CHILDREN = 12, 14.0, 7.0, 48
#: Bodies so near each other (m, each axis), on the same prints, going alike (m/s, each axis), are at the same place.
_NEAR_M, _ALIKE = 0.08, 0.3
#: What is known of who has a name; what belongs to a name, not to the body that has it.
OWN = ("own", "own_n", "own_pace", "own_pace_n", "own_girth", "own_girth_n", "own_sole", "own_sole_n")
NAMED = ("label", "first", *OWN, "told_x", "told_y", "told_at")


@njit(cache=True)
def _same(one: Any, two: Any, of: NDArray[np.int64]) -> bool:
    """Whether two hypotheses put the movers at the same places on the same prints, whoever is who; ``of`` (n,) tells.

    Then the way people go on cannot tell them apart: only how they look and walk can (`identity`).
    """
    for b in range(one.size):
        p = one[b]
        of[b] = -1
        if not (p.used and p.confirmed):
            continue
        found = False
        for o in range(two.size):
            # Most often it is the same one.
            q = two[(b + o) % two.size]
            of[b] = (b + o) % two.size
            if not (q.used and q.confirmed):
                continue
            near = _NEAR_M if p.a_print < 0 and p.b_print < 0 else 4.0 * _NEAR_M
            if abs(p.x - q.x) > near or abs(p.y - q.y) > near:
                continue
            if abs(p.vx - q.vx) > _ALIKE or abs(p.vy - q.vy) > _ALIKE:
                continue
            straight = p.a_print == q.a_print and p.b_print == q.b_print
            if straight or (p.a_print == q.b_print and p.b_print == q.a_print):
                found = True
                break
        if not found:
            return False
    return True


@njit(cache=True)
def _copy(source: Any, source_belief: Array, target: Any, target_belief: Array) -> None:
    """Copy the bodies that are used, and who they may be."""
    for b in range(source.size):
        if source[b].used:
            target[b] = source[b]
            target_belief[b] = source_belief[b]
        else:
            target[b].used = 0


@njit(cache=True)
def _advance(
    hypotheses: Any,
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
    prints: Any,
    t: float,
    sight: Any,
    taken: NDArray[np.bool_],
) -> int:
    """One scan for all ``hypotheses`` (kept, n) of bodies, best first, with ``scores`` (kept,): how many there are.

    ``taken`` (m,) becomes which clusters are somebody's in the best.
    """
    n, m = hypotheses.shape[1], clusters.size
    rows = np.empty(n, np.int64)
    child_score = np.full(_CHILDREN, np.inf)
    child_parent = np.full(_CHILDREN, -1)
    child_columns = np.full((_CHILDREN, max(m, 1)), -1)
    children = 0
    everything = np.ones(m, np.bool_)
    for h in range(count):
        bodies = hypotheses[h]
        predict(bodies, t)
        k = chosen(bodies, 1, rows)
        if m == 0 or k == 0:
            if children < _CHILDREN:
                child_score[children], child_parent[children] = scores[h], h
                children += 1
            continue
        cost = np.empty((m, 2 * k + m))
        costs(clusters, of, marks, everything, prints, bodies, rows[:k], t, cost)
        known(clusters, bodies, t, cost[:, 2 * k :])
        columns = np.full(m, -1)
        best = assign(cost, columns)
        if children < _CHILDREN:
            child_score[children], child_parent[children] = scores[h] + best, h
            child_columns[children] = columns
            children += 1
        other = np.full(m, -1)
        for i in range(m):
            mine = columns[i] // 2
            if columns[i] >= 2 * k or children >= _CHILDREN:
                continue
            rival = False
            for j in range(2 * k + m):
                if j // 2 != mine and cost[i, j] < cost[i, columns[i]] + 2.0 * _BRANCH:
                    rival = True
            if not rival:
                continue
            one, two = cost[i, 2 * mine], cost[i, 2 * mine + 1]
            cost[i, 2 * mine], cost[i, 2 * mine + 1] = UNLIKELY, UNLIKELY
            total = assign(cost, other)
            cost[i, 2 * mine], cost[i, 2 * mine + 1] = one, two
            if total - best < _BRANCH:
                child_score[children], child_parent[children] = scores[h] + total, h
                child_columns[children] = other
                children += 1
    other_of, scratch = np.empty(n, np.int64), np.empty((2, n))
    owned, free = np.zeros((hypotheses.shape[0], max(m, 1)), np.bool_), np.ones(m, np.bool_)
    order = np.argsort(child_score[:children])
    kept = 0
    least = child_score[order[0]]
    for o in order:
        if kept == hypotheses.shape[0] or child_score[o] > least + _WORSE:
            break
        bodies = spare[kept]
        parent = hypotheses[child_parent[o]]
        _copy(parent, beliefs[child_parent[o]], bodies, spare_beliefs[kept])
        k = chosen(bodies, 1, rows)
        unseen = adopt(bodies, rows[:k], child_columns[o], clusters, of, marks, blank, prints, t, sight, free)
        known_already = False
        score = child_score[o] - least + unseen
        for j in range(kept):
            if _same(spare[j], bodies, other_of):
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
    for h in range(kept):
        source = best if h == 0 else (0 if h == best else h)
        _copy(spare[source], spare_beliefs[source], hypotheses[h], beliefs[h])
    scores[0], scores[best] = scores[best], scores[0]
    scores[:kept] -= scores[0]
    for i in range(m):
        taken[i] = owned[best, i]
    return kept


class Association:
    """The hypotheses about who is where; the best is ``bodies`` (n,) of `state.BODY`."""

    def __init__(self, most: int) -> None:
        self._hypotheses, self._spare = empty(BODY, (_KEPT, most)), empty(BODY, (_KEPT, most))
        self._beliefs, self._spare_beliefs = np.zeros((_KEPT, most, most)), np.zeros((_KEPT, most, most))
        self._beliefs[:] = np.eye(most)
        self._names = np.zeros(most, np.int64)
        self._scores = np.zeros(_KEPT)
        self._count = 1
        self.scattered = expected()
        self.bodies = self._hypotheses[0]

    def step(
        self, clusters: Any, of: NDArray[np.int64], marks: Array, prints: Any, t: float, sight: Any
    ) -> NDArray[np.bool_]:
        """Take in the clusters (m,) of a scan, their prints ``of`` (m,) and ``marks`` (m, 4), `View.sight`: whose."""
        taken = np.zeros(clusters.size, np.bool_)
        self._count = _advance(
            self._hypotheses,
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
            prints,
            t,
            sight,
            taken,
        )
        scatter(self.bodies, clusters, of, marks, t, self.scattered)
        return taken

    def agree(self, shoes: Array) -> None:
        """All show one kind of feet, once it is known which; ``shoes`` (2,) is what `build.count_shoes` learns."""
        agree(self._hypotheses[: self._count], shoes)

    def decide(self) -> None:
        """From now on only the best hypothesis counts."""
        self._count = 1
        self._scores[0] = 0.0

    def named(self, index: int, lost: tuple[float, float] | None = None) -> None:
        """The mover at ``index`` has a name of its own, or that of one who was ``lost`` at (x, y) m."""
        self.decide()
        christen(self.bodies, self._beliefs[0], index, *((np.nan, np.nan) if lost is None else lost))

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
            "scattered": pack(self.scattered),
        }

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        n = int(saved["count"])
        if not 1 <= n <= _KEPT:
            raise ValueError("the saved state of the floor estimator has an impossible number of hypotheses")
        self._count = n
        for name, array in (("bodies", self._hypotheses), ("beliefs", self._beliefs), ("scores", self._scores)):
            array[:n] = unpack(saved[name], array[:n])
        self.scattered[:] = unpack(saved["scattered"], self.scattered)
