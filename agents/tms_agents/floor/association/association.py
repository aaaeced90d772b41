"""Which cluster is whose foot: several hypotheses side by side, so that a crossing is decided when it is over."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tms_agents.floor.association.adopting import Pool
from tms_agents.floor.association.advancing import advance
from tms_agents.floor.association.hypotheses import nothing_known, settle
from tms_agents.floor.association.identity import christen, renamed
from tms_agents.floor.feet.bodies import begin
from tms_agents.floor.feet.brightness import expected, scatter
from tms_agents.floor.feet.build import agree
from tms_agents.floor.feet.left_feet import put
from tms_agents.floor.scan.clustered import BLANK, ClusteredScan
from tms_agents.floor.scan.freespace import Sight
from tms_agents.floor.scan.masks import joined
from tms_agents.floor.settings import Polygon
from tms_agents.floor.state import BODY, FEET, empty, pack, unpack

Array = NDArray[np.float64]

#: Hypotheses kept.
_KEPT = 14
#: Of a scan so many bodies that took the same feet are kept, to be copied.
_POOL = 256
#: Who began so near (m) the end of a robot is a part of it.
_BEGAN_M = 0.1
#: What is known of who has a name; what belongs to a name, not to the body that has it.
OWN = (
    "own",
    "own_n",
    "own_stance",
    "own_stance_n",
    "own_leg_width",
    "own_leg_width_n",
    "own_shoe_length",
    "own_shoe_length_n",
)
NAMED = ("label", "first", *OWN, "told_x", "told_y")


class Association:
    """The hypotheses about who is where; the best is ``bodies`` (``most``,) of `state.BODY`; so many ``prints``.

    On ``seats`` people lift their feet.
    """

    def __init__(self, most: int, prints: int, seats: Sequence[Polygon] = ()) -> None:
        self.seats = joined(seats)
        self._now, self._spare = nothing_known(_KEPT, most, prints), nothing_known(_KEPT, most, prints)
        self._pool = Pool(empty(BODY, _POOL), np.zeros((_POOL, 4), np.int64), np.zeros(_POOL), np.zeros(most, np.int64))
        self._before, self._decided = np.zeros_like(self._now.raw[:1]), np.zeros(most, np.bool_)
        self._names = np.zeros(most, np.int64)
        self._scores = np.zeros(_KEPT)
        self._count = 1
        self.scattered = expected()

    @property
    def bodies(self) -> Any:
        """Those of the best hypothesis, until the next scan."""
        return self._now.bodies[0]

    def step(self, scan: ClusteredScan, sight: Sight) -> NDArray[np.bool_]:
        """Take in a scan. Which of its clusters are somebody's (m,)."""
        taken = np.zeros(scan.clusters.size, np.bool_)
        self._count = advance(
            self._now,
            self._spare,
            self._scores,
            self._count,
            scan,
            self.scattered,
            sight,
            self.seats,
            self._pool,
            taken,
        )
        self._now, self._spare = self._spare, self._now
        scatter(self.bodies, scan.clusters, scan.of, scan.marks, scan.t, self.scattered)
        return taken

    def agree(self, shoes: Array) -> None:
        """All show one kind of feet, once it is known which; ``shoes`` (2,) is what `build.count_shoes` learns."""
        agree(self.hypotheses, shoes)

    def mark(self) -> None:
        """From now on until `settle` what is known of the best hypothesis may change."""
        self._before[:] = self._now.raw[:1]
        self._decided[:] = False

    def decide(self, *indices: int) -> None:
        """What is found of these movers is so: hypotheses in which they are others count no more."""
        self._decided[list(indices)] = True

    def decide_changed(self) -> None:
        """The same of everybody who is another one since `mark`."""
        self._decided |= (self._before[0] != self._now.raw[0])[:, :FEET].any(axis=1)

    def settle(self) -> None:
        """What has changed since `mark` is so in all hypotheses in which it was as in the best."""
        if self._count > 1:
            self._count = settle(self._now, self._before, self._decided, self._scores, self._count)

    def named(self, index: int, lost: tuple[float, float] | None = None) -> None:
        """The mover at ``index`` has a name of its own, or that of one who was ``lost`` at (x, y) m."""
        self.decide(index)
        for bodies, belief in zip(self.hypotheses, self._now.beliefs[: self._count], strict=True):
            christen(bodies, belief, index, *((np.nan, np.nan) if lost is None else lost))

    @property
    def belief(self) -> Array:
        """How likely each body of the best hypothesis is who has each name (n, n), until the next scan."""
        belief: Array = self._now.beliefs[0]
        return belief

    def rename(self, t: float) -> list[tuple[int, int]]:
        """Give people their own names back: the labels that are exchanged, one pair after the other."""
        if not renamed(self.bodies, self.belief, t, self.scattered, self._names):
            return []
        changed = np.flatnonzero(self._names != np.arange(self._names.size))
        source = self._names[changed]
        exchanges = _exchanges(self._names, self.bodies["label"])
        for bodies, belief in zip(self.hypotheses, self._now.beliefs[: self._count], strict=True):
            for field in NAMED:
                bodies[field][changed] = bodies[field][source]
            belief[:, changed] = belief[:, source]
        return exchanges

    @property
    def hypotheses(self) -> Any:
        """All that are kept, (h, ``most``) of `state.BODY`, the best first."""
        return self._now.bodies[: self._count]

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
            self._before[0, index] = self._now.raw[0, index]
        return index

    def _free(self) -> int:
        """The first that is nobody in any hypothesis; -1: none."""
        free = np.flatnonzero(~self.hypotheses["used"].any(axis=0))
        return int(free[0]) if free.size else -1

    def lift(self, print_: int) -> None:
        """Nobody stands on this print any more, whatever hypothesis holds."""
        for foot in ("a_print", "b_print"):
            on = self.hypotheses[foot]
            on[on == print_] = -1

    def forget(self, index: int) -> None:
        """The mover at ``index`` has gone, whatever hypothesis holds."""
        self._now.bodies["used"][: self._count, index] = 0

    def save(self) -> dict[str, Any]:
        """JSON values: all hypotheses, and what is known of brightness."""
        n = self._count
        return {
            "count": n,
            "bodies": pack(self._now.bodies[:n]),
            "beliefs": pack(self._now.beliefs[:n]),
            "scores": pack(self._scores[:n]),
            "nobodys_at": pack(self._now.nobodys_at[:n]),
            "scattered": pack(self.scattered),
        }

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        n = int(saved["count"])
        if not 1 <= n <= _KEPT:
            raise ValueError("the saved state of the floor estimator has an impossible number of hypotheses")
        self._count = n
        for name, array in (
            ("bodies", self._now.bodies),
            ("beliefs", self._now.beliefs),
            ("scores", self._scores),
            ("nobodys_at", self._now.nobodys_at),
        ):
            array[:n] = unpack(saved[name], array[:n])
        self.scattered[:] = unpack(saved["scattered"], self.scattered)


def _exchanges(names: NDArray[np.int64], labels: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Exchanges of two labels, one after the other, that come to what happens if each body gets the label of another.

    ``names`` (n,): whose; of every circle the first exchanges its label with all others of it in turn.
    """
    found, done = [], set[int]()
    for first in range(names.size):
        following = int(names[first])
        while following != first and first not in done:
            found.append((int(labels[first]), int(labels[following])))
            done.add(following)
            following = int(names[following])
    return found
