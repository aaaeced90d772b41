"""Furniture of which now this part comes back, now that: what is taken for somebody is found out, and learned."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from tms_agents.floor.feet.build import knows_feet, wears_shoes
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.background import FOREGROUND
from tms_agents.floor.scan.furniture import ADOPTED, MOVED

#: Who stays within this (m) hardly ever looks broader (m): where people show legs, where they may show shoes.
_STAY_M, _BROAD_M, _BROAD_SHOES_M = 0.6, 0.3, 0.35
#: What has stayed for so long (s), and was broader for longer (s) and for a larger share of that, is furniture.
_STAYS_S, _SELDOM_S, _SELDOM = 6.0, 0.6, 0.04
#: The same of whom the feet are known, where they may be shoes.
_STAYS_LONG_S, _NOW_AND_THEN_S, _NOW_AND_THEN = 12.0, 1.0, 0.12
#: Nor does he look so thin (m) for so much of the time, where people show legs and where they may show shoes, also that
#: far away that beams are farther apart than this (m).
_THIN_M, _THIN_LEGS, _THIN_SHOES, _THIN_FAR = 0.05, 0.4, 0.7, 0.85
_FAR_M = 0.02
#: Of shoes that stand something comes back in more than a share of this less than 1 of the scans.
_MISSED = 0.6
#: Nobody's feet land so often (1/s) in so long (s), seen from as far; nearby each scan sees a leg anew that swings.
_LANDS_S, _LEGS_LAND, _SHOES_LAND = 8.0, 4.5, 3.5
#: What is pushed goes so far (m) at most.
_PUSHED_M = 1.5
#: Who was seen so often was as wide (m) as a part of a foot once.
_OFTEN, _PART_M = 100, 0.06
#: What flickers is looked at for so long (s), and is no farther (m) around than half of what was seen of it.
_LEARNED_S, _AROUND_M = 10.0, 0.15
#: Not while somebody is so near (m).
_BESIDE_M = 0.8


@njit(cache=True)
def note_stay(body: Any, dt: float, legs: bool) -> None:
    """Note how long (s) it is seen where it is, broader or thinner than who stands, and how often feet landed."""
    if norm(body.x - body.stay_x, body.y - body.stay_y) > _STAY_M:
        body.stay_x, body.stay_y = body.x, body.y
        body.stay, body.stay_broad, body.stay_thin, body.stay_lands = 0.0, 0.0, 0.0, 0.0
    body.stay += dt
    if body.broadest > (_BROAD_M if legs else _BROAD_SHOES_M):
        body.stay_broad += dt
    elif 0.0 < body.broadest < _THIN_M:
        body.stay_thin += dt
    body.stay_lands += (1.0 if body.a_since == body.seen else 0.0) + (1.0 if body.b_since == body.seen else 0.0)


@njit(cache=True)
def flickers(body: Any, legs: bool, t: float) -> bool:
    """Whether it is furniture of which now this comes back, now that: no person looks so where he stays.

    Where people show ``legs`` more is known of them.
    """
    if body.robot or body.machine:
        return False
    return bool(_is_thin(body, legs) or _is_seldom(body, t) or _lands(body, legs) or _is_broad(body, legs))


@njit(cache=True)
def _is_thin(body: Any, legs: bool) -> bool:
    """Too thin for too much of the time, or never a foot."""
    share = _THIN_LEGS if legs else _THIN_SHOES if body.spacing < _FAR_M else _THIN_FAR
    thin = body.stay > _STAYS_S and body.stay_thin > share * body.stay
    return bool(thin or (body.hits > _OFTEN and body.far < _PART_M))


@njit(cache=True)
def _is_seldom(body: Any, t: float) -> bool:
    """Hardly ever seen, and then too thin for shoes, where it rests."""
    seldom = body.missed > _MISSED and body.width < _THIN_M and t - body.rest_at > _STAYS_S
    return bool(seldom and wears_shoes(body))


@njit(cache=True)
def _lands(body: Any, legs: bool) -> bool:
    """Its feet land too often."""
    often = body.stay_lands > (_LEGS_LAND if legs else _SHOES_LAND) * body.stay
    return bool(body.stay > _LANDS_S and often and body.spacing > _FAR_M)


@njit(cache=True)
def _is_broad(body: Any, legs: bool) -> bool:
    """Too broad too often."""
    if norm(body.x - body.x0, body.y - body.y0) > _PUSHED_M and not knows_feet(body):
        # It came by itself: a robot, maybe.
        return False
    stays, least, share = _STAYS_S, _SELDOM_S, _SELDOM
    if not legs and knows_feet(body):
        stays, least, share = _STAYS_LONG_S, _NOW_AND_THEN_S, _NOW_AND_THEN
    return bool(body.stay > stays and body.stay_broad > max(least, share * body.stay))


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
        for note in ("stay", "stay_broad", "stay_thin", "stay_lands"):
            body[note] = 0.0

    def step(self, view: Any, clusters: Any, bodies: Any, t: float) -> int:
        """Learn what of the clusters (m,) is a part of it as background; what is not moves to the front: how many."""
        kept = np.ones(clusters.size, bool)
        seen = (bodies["used"] == 1) & (bodies["confirmed"] == 1) & (bodies["stale"] == 0)
        dt, self._t = t - self._t, t
        for index, (x, y, around, seconds) in enumerate(self.places):
            away = np.hypot(bodies["x"] - x, bodies["y"] - y)
            # Who stays there and has been nowhere else is another part of it.
            part = (away < around) & (np.hypot(bodies["x0"] - x, bodies["y0"] - y) < around)
            part &= bodies["stay"] > _STAYS_S
            if not (seen & ~part & (away < around + _BESIDE_M)).any():
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
