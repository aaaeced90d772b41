"""Furniture of which now this part comes back, now that: it is learned where it stands, though nothing of it rests."""

from __future__ import annotations

from typing import Any

import numpy as np

from tms_agents.floor.background import FOREGROUND
from tms_agents.floor.furniture import ADOPTED, MOVED

#: It is looked at for so long (s), and is no farther (m) around than half of what was seen of it.
_LEARNED_S, _AROUND_M = 10.0, 0.15
#: Not while somebody is so near (m).
_BESIDE_M = 0.8


class Flickering:
    """Where such furniture stands that is being learned."""

    def __init__(self) -> None:
        #: (x, y) m, how far around (m), for how long yet (s); when that was.
        self.places: list[tuple[float, float, float, float]] = []
        self._t = 0.0

    def found(self, body: Any, t: float) -> None:
        """What was taken for the body (`state.BODY`) is furniture."""
        self.places.append((float(body["x"]), float(body["y"]), 0.5 * float(body["far"]) + _AROUND_M, _LEARNED_S))
        self._t = t

    def step(self, view: Any, clusters: Any, bodies: Any, t: float) -> int:
        """Learn what of the clusters (m,) is a part of it as background; what is not moves to the front: how many."""
        kept = np.ones(clusters.size, bool)
        seen = (bodies["used"] == 1) & (bodies["confirmed"] == 1) & (bodies["stale"] == 0)
        dt, self._t = t - self._t, t
        for index, (x, y, around, seconds) in enumerate(self.places):
            if not (seen & (np.hypot(bodies["x"] - x, bodies["y"] - y) < around + _BESIDE_M)).any():
                kept &= np.hypot(clusters["x"] - x, clusters["y"] - y) > around
                self.places[index] = (x, y, around, seconds - dt)
        self.places = [place for place in self.places if place[3] > 0.0]
        for cluster in clusters[~kept]:
            span = np.arange(int(cluster["first"]), int(cluster["last"]) + 1)
            span = span[view.background.states[span] == FOREGROUND]
            view.background.adopt(span, view.ranges[span], ADOPTED[MOVED])
        count = int(kept.sum())
        clusters[:count] = clusters[kept]
        return count

    def save(self) -> dict[str, Any]:
        """JSON values."""
        return {"places": self.places, "t": self._t}

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        self.places = [(float(x), float(y), float(around), float(s)) for x, y, around, s in saved["places"]]
        self._t = float(saved["t"])
