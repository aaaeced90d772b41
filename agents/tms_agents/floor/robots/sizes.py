"""How large robots are, where nobody told it: learned from those that go by themselves, seen from all sides.

Rectangles of all sizes are fitted to what is seen of such a robot. One that is too small leaves points beside it, of
one that is too large beams pass through the corners (`outline.quality`); from one side alone nobody knows how deep a
robot is, so that several views are added up.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.scan.outline import search
from tms_agents.floor.state import pack, unpack

Array = NDArray[np.float64]

#: Half lengths and widths that are tried (m); so many directions.
_HALVES, _YAWS = np.arange(0.15, 0.46, 0.025), 8
#: What is looked at is so wide (m), of so many beams, so near (m) where the robot is, which was seen so lately (s), has
#: moved so far (m) since it was looked at last, and had people beside it for less than this share of its way.
_WIDE_M, _BEAMS, _NEAR_M, _SEEN_S, _MOVED_M, _PUSHED = 0.22, 10, 0.35, 0.3, 0.06, 0.15
#: So many looks tell a size, if it fits so well in the mean, and so much (sum) better than those that differ by more
#: than this (half, m); sizes that fit nearly as well (sum) are one with it, what is so much worse is not tried again.
_LOOKS, _FITS, _BETTER, _APART_M, _ALIKE, _HOPELESS = 24, 0.85, 1.0, 0.06, 0.3, 3.0
#: So many sizes are learned at most; the places of so many robots are remembered.
_MOST, _ROBOTS = 3, 32


@njit(cache=True)
def weigh(
    x: float,
    y: float,
    halves: Array,
    sums: Array,
    at: Array,
    how: Array,
    ranges: Array,
    states: NDArray[np.int8],
    rays: Array,
    pose: Array,
    first: float,
    step: float,
) -> None:
    """Add to ``sums`` (n, n) how well rectangles of half length i and width j <= i fit what is seen at (x, y)."""
    least = sums.max() - _HOPELESS
    for i in range(halves.size):
        for j in range(i + 1):
            if sums[i, j] < least:
                continue
            at[0], at[1], at[2] = x, y, 0.0
            sums[i, j] += search(at, halves[i], halves[j], _YAWS, how, ranges, states, rays, pose, first, step)


class RobotSizes:
    """Learns up to three sizes from robots that were recognized by their way and are not followed by an outline."""

    def __init__(self) -> None:
        #: Half length and half width (m) of those known by now.
        self.known: list[tuple[float, float]] = []
        self._sums, self._looks = np.zeros((_HALVES.size, _HALVES.size)), 0
        #: Where each robot was, by its label, when it was looked at last.
        self._at: dict[int, tuple[float, float]] = {}

    def look(self, bodies: Any, clusters: Any, scan: Any, t: float) -> None:
        """Learn from a ``scan``, as `outline.search` takes it, in which there are ``bodies`` and ``clusters``."""
        machines = (bodies["used"] == 1) & (bodies["machine"] == 1) & (bodies["footprint"] == 0)
        if not machines.any() or len(self.known) == _MOST:
            return
        plain = (clusters["cut"] == 0) & (clusters["attached"] == 0) & (clusters["mirror"] < 0)
        whole = clusters[plain & (clusters["n"] >= _BEAMS) & (clusters["width"] > _WIDE_M)]
        seen = machines & (t - bodies["seen"] < _SEEN_S) & (bodies["pushed"] < _PUSHED)
        for body in bodies[seen] if whole.size else ():
            x, y, label = float(body["x"]), float(body["y"]), int(body["label"])
            u, v = self._at.get(label, (np.inf, np.inf))
            away = np.hypot(whole["x"] - x, whole["y"] - y)
            if away.min() > _NEAR_M or np.hypot(x - u, y - v) < _MOVED_M:
                continue
            self._at[label] = (x, y)
            if len(self._at) > _ROBOTS:
                del self._at[next(iter(self._at))]
            cluster = whole[away.argmin()]
            weigh(cluster["x"], cluster["y"], _HALVES, self._sums, np.zeros(3), np.zeros(6), *scan)
            self._looks += 1
            self._decide()

    def _decide(self) -> None:
        """One size fits best by far: it is known."""
        best = float(self._sums.max())
        i, j = np.unravel_index(int(self._sums.argmax()), self._sums.shape)
        other = np.maximum(abs(_HALVES[:, None] - _HALVES[i]), abs(_HALVES - _HALVES[j])) > _APART_M
        sure = best > _FITS * self._looks and best - self._sums[other].max() > _BETTER
        if self._looks < _LOOKS or not sure:
            return
        alike = np.argwhere(~other & (self._sums > best - _ALIKE))
        size = float(_HALVES[alike[:, 0]].mean()), float(_HALVES[alike[:, 1]].mean())
        if not any(max(abs(size[0] - a), abs(size[1] - b)) < _APART_M for a, b in self.known):
            self.known.append(size)
        self._sums[:], self._looks, self._at = 0.0, 0, {}

    def save(self) -> dict[str, Any]:
        """JSON values."""
        at = [[label, x, y] for label, (x, y) in self._at.items()]
        return {"known": self.known, "sums": pack(self._sums), "looks": self._looks, "at": at}

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        self.known = [(float(a), float(b)) for a, b in saved["known"]]
        self._sums, self._looks = unpack(saved["sums"], self._sums), int(saved["looks"])
        self._at = {int(label): (float(x), float(y)) for label, x, y in saved["at"]}
