"""The life of a mover: believed when it has walked, stale while hidden or seated, gone when its place is seen empty."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.absent import Absent
from tms_agents.floor.association import Association
from tms_agents.floor.bodies import misled, stuck
from tms_agents.floor.events import Appeared, Back, FloorEvent, FloorLabel, Moved, Stale, Vanished
from tms_agents.floor.freespace import FREE, HIDDEN, UNSEEN, WALLED, clear
from tms_agents.floor.gait import SHOES
from tms_agents.floor.masks import Area
from tms_agents.floor.settings import FloorSettings, Scene

Array = NDArray[np.float64]

#: What `_review` finds of a body.
_NOTHING, _CONFIRM, _LOST, _BACK, _GONE, _MOVED = 0, 1, 2, 3, 4, 5
#: A person of whom one foot alone is seen, unmoved, for so long (s) is not there.
_LONE_S = 4.0
#: Where the other foot was last seen, within this (m), and it may be hidden, time counts by this share.
_BEHIND, _STEP_M = 0.2, 0.1
#: What had stood there for so long (s) before somebody's only foot came there is most likely a thing: time counts more.
_OLDER_S, _FASTER = 1.0, 2.5
#: Nobody stands for so long (s) without shifting a foot.
_STILL_S = 40.0
#: What was pushed stands still for so long (s): it is furniture.
_PARKED_S = 5.0
#: No leg and no shoe looks so broad in the long run (m); so broad (m) a person is never, and of a person two feet are
#: seen in this share of the scans at least.
_BROAD_LEG_M, _BROAD_SHOE_M, _FAR_M, _FEET = 0.27, 0.36, 0.35, 0.25
#: What moved with people beside it for this share of its way may have been pushed.
_BESIDE = 0.15
#: What began as a piece of furniture and is still so broad (m) in the mean is one.
_PIECE_M = 0.25
#: Who stays within this (m) rests.
_REST_M = 0.15
#: How much what is seen of a mover must look like feet (`footlike`) in the long run.
_QUALITY = 0.3
#: Who was seen so often is somebody; how much what is seen next of somebody lost must look like feet.
_KNOWN, _DOUBTED = 200, 0.5
#: What is new for so long (s) may turn out to be furniture.
_NEW_S = 30.0
#: What is pushed is left within this (m).
_PUSHED_M = 2.0
#: What has moved with people beside it for less than this share of the way has moved by itself.
_ALONE = 0.3
#: Nobody stands with the feet so far apart (m) for long.
_ASTRIDE_M = 0.48
#: So near (m) the edge of a thing that has stood for so long (s) is no second foot; feet are so wide at most (m).
_SLIVER_M, _SLIVER_S, _SHOE_M = 0.035, 10.0, 0.15
#: Two of them so near each other (m) are one.
_UNITE_M = 0.45
#: A mover is told again when it has moved so far (m).
_TELL_M = 0.05
#: A seated person's feet vanish so near the seat (m), and those of somebody who goes where nobody is looked for.
_SEAT_M, _MASK_M = 0.45, 0.3
#: Somebody hidden may come out so far away (m), and may have walked so fast (m/s).
_OUT_M, _SPEED = 0.5, 0.9


@njit(cache=True)
def _is_lone(body: Any, t: float) -> bool:
    """Whether of a person only one thing is seen, or two too far apart to stand on, unmoved for some time."""
    if body.robot or body.wide > 0.6 or body.width > 0.2:
        return False
    a, b = t - body.a_seen, t - body.b_seen
    apart = np.hypot(body.ax - body.bx, body.ay - body.by)
    sliver = apart < 0.5 * min(body.width, _SHOE_M) + _SLIVER_M and t - min(body.a_since, body.b_since) > _SLIVER_S
    astride = max(a, b) < 0.5 and apart > _ASTRIDE_M and t - max(body.a_since, body.b_since) > 1.5
    if body.still > _STILL_S or sliver or astride:
        return True
    since = body.a_since if a < b else body.b_since
    return bool(max(a, b) > 1.0 and t - since > 1.0)


@njit(cache=True)
def _is_parked(body: Any, t: float) -> bool:
    """Whether it is as wide as furniture, has never gone far by itself, and stands still."""
    if body.machine:
        return False
    since = body.a_since if body.a_seen >= body.b_seen else body.b_since
    if body.wide > 0.5:
        return bool(t - since > _PARKED_S)
    if body.pushed < _BESIDE and body.from_furniture != 1 and not _is_known(body):
        # It came by itself.
        return False
    # Furniture half hidden by who pushes it: as broad as no leg or shoe, or broad once and hardly ever on two feet.
    rests = t - body.rest_at
    broad = body.width > (_BROAD_SHOE_M if body.shoe >= SHOES else _BROAD_LEG_M)
    return bool((broad and rests > _PARKED_S) or (_is_footless(body) and rests > 2.0 * _PARKED_S))


@njit(cache=True)
def _is_known(body: Any) -> bool:
    """Whether two feet have been seen so often that it is a person."""
    return bool(body.hits > _KNOWN and body.both > _FEET * body.hits)


@njit(cache=True)
def _is_footless(body: Any) -> bool:
    """Whether it has been broader than two feet side by side, and two feet were hardly ever seen."""
    return bool(not body.machine and body.far > _FAR_M and body.both < _FEET * body.hits)


@njit(cache=True)
def _accompanied(bodies: Any, b: int, t: float) -> bool:
    """Whether a person is so near something wide that it may be pushed."""
    for o in range(bodies.size):
        other = bodies[o]
        person = o != b and other.used and other.confirmed and not other.robot and t - other.seen < 0.5
        if person and np.hypot(other.x - bodies[b].x, other.y - bodies[b].y) < 0.6 + 0.5 * bodies[b].far:
            return True
    return False


@njit(cache=True)
def _review(
    bodies: Any,
    t: float,
    dt: float,
    ranges: Array,
    states: NDArray[np.int8],
    longest: Array,
    pose: Array,
    first: float,
    step: float,
    confirm_s: float,
    confirm_m: float,
    leave_s: float,
    hidden_s: float,
    stale_s: float,
    actions: NDArray[np.int64],
    inside: bool,
    learned: bool,
) -> None:
    """What is due for each body, into ``actions``; drops tentative ones that came to nothing."""
    for b in range(bodies.size):
        body = bodies[b]
        actions[b] = _NOTHING
        if not body.used:
            continue
        unseen = t - body.seen
        if (body.wide > 0.3 or body.far > _FAR_M) and unseen == 0.0 and np.hypot(body.vx, body.vy) > 0.08:
            body.pushed += 0.08 * ((1.0 if _accompanied(bodies, b, t) else 0.0) - body.pushed)
        if unseen == 0.0 and np.hypot(body.x - body.rest_x, body.y - body.rest_y) > _REST_M:
            body.rest_x, body.rest_y, body.rest_at = body.x, body.y, t
        if not body.confirmed:
            way = np.hypot(body.x - body.x0, body.y - body.y0)
            age = body.seen - body.first
            parked = body.from_furniture == 1 and t - body.rest_at > _PARKED_S
            if unseen > 0.45 or (age > 3.0 and way < 0.15) or parked or body.hits < 0.5 * body.looks - 1.0:
                body.used = 0
                continue
            if unseen > 0.0:
                continue
            beside, halved, part = np.inf, False, False
            for o in range(bodies.size):
                if o != b and bodies[o].used and bodies[o].confirmed and not bodies[o].stale:
                    away = np.hypot(bodies[o].x - body.x, bodies[o].y - body.y)
                    beside = min(beside, away)
                    # A part of somebody who is wide: legs that are one thing to the laser fall apart now and then.
                    part = part or away < 0.12 + 0.5 * bodies[o].width
                    # One foot of somebody there is not seen now: this may be it.
                    if away < 0.6 and not bodies[o].robot and max(t - bodies[o].a_seen, t - bodies[o].b_seen) > 0.3:
                        halved = True
            if part:
                body.used = 0
                continue
            needed_s = confirm_s if beside > 0.6 else 3.0 * confirm_s
            needed_m = confirm_m if beside > 0.6 else 1.5 * confirm_m
            if halved:
                needed_s = 8.0 * confirm_s
            if not learned:
                needed_s, needed_m = 2.0 * needed_s, 2.0 * needed_m
            if body.wide > 0.5:
                # Furniture that is pushed aside looks like a robot at first.
                needed_s, needed_m = 2.0 * needed_s, 2.0 * needed_m
            if age >= needed_s and way >= needed_m and body.hits >= 4 and body.score >= max(3.0, 0.45 * body.hits):
                actions[b] = _CONFIRM
            continue
        if unseen == 0.0:
            only_a = body.a_seen >= body.b_seen
            foot_x, foot_y = (body.ax, body.ay) if only_a else (body.bx, body.by)
            if _is_lone(body, t):
                x, y, at = (body.bx, body.by, body.b_seen) if only_a else (body.ax, body.ay, body.a_seen)
                behind = t - at > 0.5 and clear(x, y, _STEP_M, ranges, states, longest, pose, first, step) == HIDDEN
                if body.lone == 0.0:
                    body.lone_x, body.lone_y = foot_x, foot_y
                if body.older > _OLDER_S:
                    body.lone += dt * _FASTER
                else:
                    body.lone += dt * (_BEHIND if behind else 1.0)
            elif (
                max(t - body.a_seen, t - body.b_seen) < 1.0
                or np.hypot(foot_x - body.lone_x, foot_y - body.lone_y) > _STEP_M
            ):
                # What was hidden meanwhile goes on being alone.
                body.lone = 0.0
            single = not body.robot and body.wide < 0.15 and max(t - body.a_seen, t - body.b_seen) > 0.9
            body.single = body.single + dt if single else 0.0
            if body.lone > _LONE_S or (misled(body) and body.hits > _KNOWN):
                # One thing that does not move is no person: whoever it was is somewhere else.
                actions[b] = _LOST
            elif body.quality < _QUALITY or misled(body) or _is_parked(body, t):
                # Somebody who is known for long has gone on from there.
                actions[b] = _LOST if _is_known(body) else _GONE
            elif body.stale:
                actions[b] = _BACK
            elif np.hypot(body.x - body.told_x, body.y - body.told_y) > _TELL_M:
                actions[b] = _MOVED
            continue
        if unseen > 0.12:
            view = clear(body.x, body.y, 0.15, ranges, states, longest, pose, first, step)
            if view == FREE:
                body.clear += dt
            elif view == UNSEEN or (view == WALLED and not inside):
                body.clear += 0.5 * dt
            elif view == HIDDEN:
                body.clear = max(0.0, body.clear - 0.5 * dt)
        if body.clear > leave_s or unseen > hidden_s:
            actions[b] = _GONE
        elif unseen > stale_s and not body.stale:
            actions[b] = _LOST


class Tracks:
    """Movers: which of ``bodies`` are believed, their labels and events."""

    def __init__(self, association: Association, settings: FloorSettings, scene: Scene) -> None:
        self._association = association
        self.bodies = association.bodies
        self._settings = settings
        self._seats, self._masks, self._gates = Area(scene.seats), Area(scene.masks), Area(scene.gates)
        self._region = Area([] if scene.region is None else [scene.region])
        self._robots = [tuple(sorted(size)) for size in scene.robots]
        self.absent = Absent(self._gates)
        self._actions = np.zeros(self.bodies.size, np.int64)

    def review(
        self,
        t: float,
        dt: float,
        sight: tuple[Any, ...],
        new_label: Callable[[], int],
        was_furniture: Callable[[Any], bool],
        *,
        learned: bool,
    ) -> list[FloorEvent]:
        """What happened to the movers in the scan at t, ``dt`` after the sensor's last; ``sight`` as `clear` takes.

        ``was_furniture`` tells of a body whether a piece of background has gone from where it began.
        """
        s = self._settings
        review: Any = _review
        review(
            self.bodies,
            t,
            dt,
            *sight,
            s.confirm_s,
            s.confirm_m,
            s.leave_s,
            s.hidden_s,
            s.stale_s,
            self._actions,
            bool(self._region.polygons),
            learned,
        )
        self._association.rename(t)
        events: list[FloorEvent] = self.absent.gone(t) + self._unite(t)
        for index in np.flatnonzero(self._actions).tolist():
            body, action = self.bodies[index], self._actions[index]
            if action == _GONE:
                events += self._gone(index, t)
            elif action == _LOST:
                events += self._lost(index, t)
            elif action == _BACK:
                body["stale"] = 0
                events.append(Back(t, int(body["label"]), _xy(body)))
                _told(body, t)
            elif action == _CONFIRM:
                events += self._confirm(index, t, new_label, was_furniture)
            elif (
                (body["wide"] > 0.5 or _is_footless(body))
                and t - body["first"] < _NEW_S
                and body["from_furniture"] == 0
                and (body["pushed"] > 0.8 or was_furniture(body))
            ):
                # Furniture that is pushed is seen to be missing only when the one who pushes has left its place.
                self._association.decide()
                body["confirmed"], body["from_furniture"], body["robot"] = 0, 1, 0
                events.append(Vanished(t, int(body["label"]), float(body["seen"]), t))
            else:
                events.append(Moved(t, int(body["label"]), _xy(body), _cov(body)))
                _told(body, t)
        return events

    def labels(self, t: float) -> list[FloorLabel]:
        """The movers there are."""
        return [
            FloorLabel(
                int(body["label"]),
                "mover",
                _xy(body),
                _cov(body),
                float(body["first"]),
                float(body["seen"]),
                None if body["stale"] else (float(body["vx"]), float(body["vy"])),
                bool(body["robot"]),
                bool(body["stale"]),
            )
            for body in self.bodies
            if body["used"] and body["confirmed"]
        ]

    def _gone(self, index: int, t: float) -> list[FloorEvent]:
        body = self.bodies[index]
        if t - body["seen"] < (
            86400.0 if self._seated(body) else self._settings.hidden_s if self._masked(body) else 0.0
        ):
            body["clear"] = 0.0
            return self._lost(index, t)
        self._association.forget(index)
        if body["clear"] > self._settings.leave_s and self.absent.keep(body):
            return [] if body["stale"] else [Stale(t, int(body["label"]))]
        return [Vanished(t, int(body["label"]), float(body["seen"]), t)]

    def _unite(self, t: float) -> list[FloorEvent]:
        """Two movers with one foot each at one place are one: the younger label goes."""
        bodies = self.bodies
        lone = np.flatnonzero((bodies["used"] == 1) & (bodies["confirmed"] == 1) & (bodies["single"] > 0.5))
        events: list[FloorEvent] = []
        for index in lone.tolist():
            for other in lone.tolist():
                one, two = bodies[other], bodies[index]
                near = math.hypot(one["x"] - two["x"], one["y"] - two["y"]) < _UNITE_M
                if near and one["used"] and two["used"] and one["label"] < two["label"]:
                    self._association.decide()
                    self._association.forget(index)
                    if not self.absent.keep(two):
                        events.append(Vanished(t, int(two["label"]), float(two["seen"]), t))
        return events

    def _lost(self, index: int, t: float) -> list[FloorEvent]:
        body = self.bodies[index]
        if body["stale"]:
            return []
        if self._outside(body):
            self._association.forget(index)
            return [Vanished(t, int(body["label"]), float(body["seen"]), t)]
        if body["seen"] == t:
            # What is seen is something else.
            self._association.decide()
            body["a_print"] = body["b_print"] = -1
            body["a_seen"] = body["b_seen"] = -1e9
            body["lone"] = body["wide"] = 0.0
            body["quality"] = max(body["quality"], _DOUBTED)
        body["stale"] = 1
        body["vx"] = body["vy"] = 0.0
        return [Stale(t, int(body["label"]))]

    def _seated(self, body: Any) -> bool:
        return self._seats.distance(body["ax"], body["ay"]) < _SEAT_M

    def _masked(self, body: Any) -> bool:
        return self._masks.distance(body["x"], body["y"]) < _MASK_M

    def _outside(self, body: Any) -> bool:
        x, y = float(body["x"]), float(body["y"])
        if self._gates.polygons:
            return self._gates.distance(x, y) < 0.3
        return bool(self._region.polygons) and self._region.distance(x, y) > 0.0

    def _confirm(
        self, index: int, t: float, new_label: Callable[[], int], was_furniture: Callable[[Any], bool]
    ) -> list[FloorEvent]:
        body = self.bodies[index]
        if body["from_furniture"] == 1 and (body["wide"] > 0.3 or body["width"] > _PIECE_M):
            # Nothing is pushed so far; it goes by itself.
            way = math.hypot(body["x"] - body["x0"], body["y"] - body["y0"])
            if way < _PUSHED_M or body["pushed"] > 0.4:
                return []
            body["from_furniture"] = -1
        elif (body["wide"] > 0.3 or _is_footless(body)) and (body["pushed"] > 0.6 or was_furniture(body)):
            body["from_furniture"] = 1
            return []
        self._association.decide()
        robot = self._is_robot(body)
        if robot and body["from_furniture"] == 0 and body["pushed"] < _ALONE:
            # It came by itself; whoever is beside it later does not push it.
            body["from_furniture"] = -1
        old = self._missing(body)
        if old is None:
            old = self.absent.find(body, self._association.scattered)
        if old is not None:
            stale, label, first = int(old["stale"]), int(old["label"]), float(old["first"])
            for field in ("own", "own_n", "own_pace", "own_pace_n"):
                body[field] = old[field]
            old["used"] = 0
            body["confirmed"], body["label"], body["first"] = 1, label, first
            self._association.named(index, _xy(old))
            body["robot"] = old["robot"]
            _told(body, t)
            return [Back(t, label, _xy(body))] if stale else [Moved(t, label, _xy(body), _cov(body))]
        body["confirmed"], body["label"], body["robot"] = 1, new_label(), int(robot)
        self._association.named(index)
        _told(body, t)
        width = float(body["width"])
        since = float(body["first"])
        return [Appeared(t, int(body["label"]), "mover", _xy(body), _cov(body), robot, since, (), width)]

    def _is_robot(self, body: Any) -> bool:
        if self._robots:
            least = min(size[0] for size in self._robots)
            most = max(math.hypot(*size) for size in self._robots)
            return bool(0.7 * least < body["far"] < 1.2 * most and body["wide"] > 0.3)
        return bool(body["wide"] > 0.5)

    def _missing(self, body: Any) -> Any:
        """The mover not seen now that this one most probably is: hidden, seated, or only thought to be seen."""
        best, best_gap = None, 1.0
        for other in self.bodies:
            if not (other["used"] and other["confirmed"]) or (other["machine"] and body["wide"] < 0.3):
                continue
            x, y, seen = float(other["x"]), float(other["y"]), float(other["seen"])
            if seen > body["first"] + 0.2:
                lost = stuck(other, float(body["seen"]))
                if lost is None:
                    continue
                x, y, seen = lost
            since = max(0.0, float(body["first"]) - seen)
            gap = math.hypot(body["x0"] - x, body["y0"] - y)
            reach = _OUT_M + min(_SPEED * since, 1.2)
            for out_of_view, area in ((self._seated, self._seats), (self._masked, self._masks)):
                if out_of_view(other):
                    gap, reach = min(gap, area.distance(body["x0"], body["y0"]) + 0.05), 0.7
            if gap / reach < best_gap:
                best, best_gap = other, gap / reach
        return best


def _told(body: Any, t: float) -> None:
    body["told_x"], body["told_y"], body["told_at"] = body["x"], body["y"], t


def _xy(body: Any) -> tuple[float, float]:
    return float(body["x"]), float(body["y"])


def _cov(body: Any) -> tuple[float, float, float]:
    # Two feet tell of the middle of a body by about 5 cm, however long they stand.
    return (variance := float(body["pp"]) + 0.0025), 0.0, variance
