"""Who of those not seen now somebody is who has just begun to be seen: hidden, seated, or only thought to be seen."""

from __future__ import annotations

import math
from typing import Any

from tms_agents.floor.feet.bodies import stuck
from tms_agents.floor.movers.absent import Absent
from tms_agents.floor.movers.lone import has_walked
from tms_agents.floor.movers.pair import is_pair
from tms_agents.floor.movers.parked import is_footless
from tms_agents.floor.movers.twice import landed
from tms_agents.floor.movers.whereabouts import Whereabouts

#: A foot that leaves lands so far away (m) within so long (s).
_STRIDE_M, STEPS_S = 1.2, 0.6
#: Somebody hidden may come out so far away (m), and may have walked so fast (m/s), so far (m) at most.
_OUT_M, _SPEED, _FARTHEST_M = 0.5, 0.9, 1.2
#: Who gets up, or comes out of what is masked, stands so near (m) there.
_BESIDE_M = 0.7
#: Who puts something down and is taken to stand on it has gone on within this (s).
_STANDS_S = 5.0


def missing_one(bodies: Any, new: Any, where: Whereabouts, absent: Absent) -> int | None:
    """Which of the ``bodies`` (n,) the ``new`` one most probably is, or None."""
    best, best_gap = None, 1.0
    broad = new["wide"] > 0.3 or is_footless(new)
    for index, body in enumerate(bodies):
        if not (body["used"] and body["confirmed"]) or (body["machine"] and new["wide"] < 0.3):
            continue
        if broad and not body["robot"] and has_walked(body):
            continue
        x, y, seen = float(body["x"]), float(body["y"]), float(body["seen"])
        steps = seen > new["first"] + 0.2
        if steps:
            lost = stuck(body, float(new["seen"]))
            # Who stands on one foot, in view, is not who comes in by a door, nor who may be somebody else.
            if lost is None or _stands(bodies, body, new, absent) or absent.enters(new):
                continue
            x, y, seen = lost
        since = max(0.0, float(new["first"]) - seen)
        gap = math.hypot(new["x0"] - x, new["y0"] - y)
        reach = _OUT_M + min(_SPEED * since, _FARTHEST_M)
        if steps and since < STEPS_S:
            reach = max(reach, _STRIDE_M)
        for out_of_view, area in ((where.seated, where.seats), (where.masked, where.masks)):
            if out_of_view(body) and not steps:
                gap, reach = min(gap, area.distance(new["x0"], new["y0"]) + 0.05), _BESIDE_M
        if gap / reach < best_gap:
            best, best_gap = index, gap / reach
    return best


def _stands(bodies: Any, body: Any, new: Any, absent: Absent) -> bool:
    """Whether who shows one foot has stood there for long, and the ``new`` one stands, too, or may be another."""
    t = float(new["seen"])
    people = (bodies["used"] == 1) & (bodies["confirmed"] == 1) & (bodies["robot"] == 0)
    others = absent.waits or (people & (bodies["label"] != body["label"])).any()
    return t - landed(body) > _STANDS_S and bool(others or is_pair(new, t))
