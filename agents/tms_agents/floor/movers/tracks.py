"""The life of a mover: believed when it has walked, stale while hidden or seated, gone when its place is seen empty."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from tms_agents.floor.association.association import OWN, Association
from tms_agents.floor.events import Appeared, Back, Covariance, FloorEvent, FloorLabel, Moved, Stale, Vanished
from tms_agents.floor.feet.place import place, tell
from tms_agents.floor.movers.absent import Absent
from tms_agents.floor.movers.doubts import Doubts
from tms_agents.floor.movers.flickering import Flickering
from tms_agents.floor.movers.meetings import Meetings
from tms_agents.floor.movers.parked import is_footless, is_somebody
from tms_agents.floor.movers.reappearing import missing_one
from tms_agents.floor.movers.review import (
    BACK,
    BROAD,
    CONFIRM,
    FLICKERS,
    GONE,
    LOST,
    MOVED,
    NOTHING,
    PIECE,
    THING,
    WIDEST_LEG_M,
    Waits,
    doubled,
    outside,
    review,
    unseen,
)
from tms_agents.floor.movers.strides import Strides
from tms_agents.floor.movers.told import Told
from tms_agents.floor.movers.twice import began, suspect
from tms_agents.floor.movers.whereabouts import Whereabouts
from tms_agents.floor.robots.recognizing import may_be_robot
from tms_agents.floor.scan.freespace import Sight
from tms_agents.floor.settings import FloorSettings, Scene
from tms_agents.floor.state import CONCEALED, NEVER, SEATED

#: How much what is seen next of somebody lost must look like feet.
_DOUBTED = 0.5
#: What was wide in such a share of late is furniture if it is nobody.
_WIDE = 0.5
#: What began as a piece of furniture and is still so broad (m) in the mean is one.
_PIECE_M = 0.25
#: What is pushed is left within this (m).
_PUSHED_M = 2.0
#: Two shoes side by side are broader (m) for a moment only. What has moved with somebody beside it for this share of
#: the way, lately above all, may be pushed by him.
_SHOES_M, _PUSHED = 0.33, 0.2
#: What has moved with people beside it for less than this share of the way has moved by itself.
_ALONE = 0.3
#: Who has stayed where he is for so long (s) when he is hidden stands on, also in a door.
_RESTS_S = 2.0
#: Who has gone out of the room and is not seen for so long (s) has left.
_THROUGH_S = 0.6
#: Who is seen so far (m) outside the region has left the room; who comes is told when he is no farther (m) from it.
_OUTSIDE_M, _INSIDE_M = 0.1, 0.05
#: Nobody sits for so long (s).
_SITS_S = 86400.0
#: Who sits does so this far (m) from the edge of the seat, and for certain, if his feet have vanished in clear view for
#: so long (s).
_DEEP_M, _CLEAR_S = 0.25, 0.3


class Tracks:
    """Movers: which of ``bodies`` are believed, their labels and events."""

    def __init__(self, association: Association, settings: FloorSettings, scene: Scene) -> None:
        self._association = association
        self._settings = settings
        self._waits = Waits(*(getattr(settings, name) for name in Waits._fields))
        self._where = Whereabouts(scene)
        self._region = self._where.region
        self._robots = scene.robots
        self.absent = Absent(self._where.gates, self._region)
        self.flickering = Flickering()
        #: Feet that were taken for things.
        self.strides = Strides()
        #: Of the scan that was reviewed last: prints that have turned out to be no feet, and those that are furniture.
        self.no_feet: list[int] = []
        self.furniture: list[int] = []
        self._told, self._doubts = Told(self.bodies.size), Doubts(self.bodies.size)
        self._meetings = Meetings(self.bodies.size)
        self._actions, self._rows = np.zeros(self.bodies.size, np.int64), np.zeros(self.bodies.size, np.int64)

    @property
    def bodies(self) -> Any:
        """All there may be in the best hypothesis, until the next scan."""
        return self._association.bodies

    def save(self) -> dict[str, Any]:
        """JSON values, without those of the association."""
        told = {"told": self._told.save(), "doubts": self._doubts.save(), "meetings": self._meetings.save()}
        of_places = {"flickering": self.flickering.save(), "strides": self.strides.save()}
        return {"absent": self.absent.save(), **of_places, **told}

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        self.absent.restore(saved["absent"])
        self.flickering.restore(saved["flickering"])
        self.strides.restore(saved["strides"])
        self._told.restore(saved["told"])
        self._doubts.restore(saved["doubts"])
        self._meetings.restore(saved["meetings"])

    def review(
        self,
        t: float,
        dt: float,
        sight: Sight,
        new_label: Callable[[], int],
        was_furniture: Callable[[Any], bool],
        is_furniture: Callable[[Any], bool],
        *,
        learned: bool,
        legs: bool = False,
    ) -> list[FloorEvent]:
        """What happened to the movers in the scan at t, ``dt`` after the sensor's last.

        ``was_furniture`` tells of a body whether a piece of background has gone from where it began, ``is_furniture``
        whether one that looks like it has gone. ``legs``: it is known that people show legs here.
        """
        judge: Any = review
        judge(self.bodies, t, dt, sight, self._waits, self._actions, bool(self._region.polygons), learned, legs)
        self.no_feet, self.furniture = [], []
        self._see_off(t)
        self._actions[list(self.strides.found(self.bodies, t))] = CONFIRM
        confused = self._doubts.look(self.bodies, self._association.belief, self._association.scattered, t)
        confused += self._doubts.given_back(self._association.rename(t), t)
        events: list[FloorEvent] = self.absent.gone(t) + self._unite(t) + self._gone_out(t)
        for index in np.flatnonzero(self._actions).tolist():
            body, action = self.bodies[index], int(self._actions[index])
            if action == NOTHING or not body["used"]:
                # It has gone meanwhile, or is somebody else's.
                continue
            if action == FLICKERS:
                self.flickering.found(body, t)
            if action in (THING, FLICKERS) or (action == PIECE and is_furniture(body)):
                if action == THING and body["wide"] > _WIDE:
                    self.furniture += _prints(body)
                # Somebody who is known for long, or has begun to be seen elsewhere, has gone on from there.
                gone_on = is_somebody(body) or began(self.bodies, body, True) >= 0
                events += self._lost(index, t, thing=True) if gone_on else self._gone(index, t)
            elif action == GONE:
                events += self._gone(index, t)
            elif action == LOST:
                events += self._lost(index, t)
            elif action == BACK:
                body["stale"] = 0
                events.append(Back(t, *self._tell(index, t)))
            elif action == CONFIRM:
                missing = missing_one(self.bodies, body, self._where, self.absent)
                if not self._is_pushed(body, missing, legs):
                    events += self._confirm(index, missing, t, new_label, was_furniture)
            elif action == BROAD and (body["pushed"] > 0.8 or was_furniture(body)):
                # Furniture that is pushed is seen to be missing only when the one who pushes has left its place.
                self._association.decide(index)
                body["confirmed"], body["from_furniture"], body["robot"] = 0, 1, 0
                events.append(Vanished(t, int(body["label"]), float(body["seen"]), t))
            elif action in (MOVED, BROAD):
                events.append(Moved(t, *self._tell(index, t)))
        met = self._meetings.gone(events, t) + self._meetings.look(self.bodies, t)
        return self._told.agree([*events, *confused, *met, *self._doubts.gone(events, t)], self.bodies, t)

    def labels(self, t: float) -> list[FloorLabel]:
        """The movers there are, but for those who are ``awaited``."""
        return [_label(body, t) for body in self.bodies if body["used"] and body["confirmed"]]

    def awaited(self, t: float) -> list[FloorLabel]:
        """Movers of whom nothing is seen and who have not left: about where they were seen last."""
        return [_label(body, t) for body in self.absent.bodies]

    def turns_up(self, prints: Any, i: int, t: float) -> list[FloorEvent]:
        """Who is waited for stands on the print i, it seems: then he is back."""
        old = self.absent.standing(prints[i], self.bodies)
        index = -1 if old is None else self._association.stand(prints, i, t)
        if index < 0:
            return []
        self.absent.found(old)
        self.bodies[index]["confirmed"] = 1
        self._go_on(index, old)
        return self._told.agree([Back(t, *self._tell(index, t))], self.bodies, t)

    def _gone(self, index: int, t: float) -> list[FloorEvent]:
        body = self.bodies[index]
        hidden_s = self._settings.hidden_s if self._where.masked(body) else 0.0
        if self._where.seated(body) and not self.absent.doors.out_of_sight(body):
            hidden_s = _SITS_S
        if t - body["seen"] < hidden_s:
            body["clear"] = 0.0
            return self._lost(index, t)
        self._association.forget(index)
        kept = self.absent.keep(body) if body["clear"] > self._settings.leave_s else None
        return self._waits_or_gone(body, self.absent.turns(body) if kept is None else kept, t)

    def _see_off(self, t: float) -> None:
        """Who has gone on out of the room while nobody saw him has left."""
        for index in self._rows[: unseen(self.bodies, t - _THROUGH_S, self._rows)].tolist():
            body = self.bodies[index]
            if self._where.through(body) and body["seen"] - body["rest_at"] < _RESTS_S:
                self._actions[index] = GONE

    def _gone_out(self, t: float) -> list[FloorEvent]:
        """Who is seen to have gone out by a door has left: whoever comes in by it next is somebody new."""
        events: list[FloorEvent] = []
        for region in self._region.polygons:
            for index in self._rows[: outside(self.bodies, t, region, _OUTSIDE_M, self._rows)].tolist():
                body = self.bodies[index]
                if self._where.leaves(body):
                    self._association.forget(index)
                    self._actions[index] = NOTHING
                    events.append(Vanished(t, int(body["label"]), t, t))
        return events

    def _unite(self, t: float) -> list[FloorEvent]:
        """Two movers with one foot each at one place are one: the younger label goes."""
        events: list[FloorEvent] = []
        while (index := doubled(self.bodies)) >= 0:
            body = self.bodies[index]
            self._association.forget(index)
            events += self._waits_or_gone(body, self.absent.keep(body), t)
        return events

    @staticmethod
    def _waits_or_gone(body: Any, kept: Any, t: float) -> list[FloorEvent]:
        """The body has left, or is ``kept`` to be waited for, about where it was seen last."""
        label = int(body["label"])
        if kept is None:
            return [Vanished(t, label, float(body["seen"]), t)]
        x, y, variance = place(kept, t)
        return [Moved(t, label, (x, y), (variance, 0.0, variance)), Stale(t, label)]

    def _lost(self, index: int, t: float, *, thing: bool = False) -> list[FloorEvent]:
        """The mover is not there; what is seen of it now, if anything, is somebody else's foot, or a ``thing``."""
        body = self.bodies[index]
        if body["stale"]:
            return []
        seated = self._where.sits(body) and not self.absent.doors.out_of_sight(body)
        walled = bool(self._region.polygons) and self._region.distance(float(body["x"]), float(body["y"])) > 0.0
        if seated or (walled and not self._where.leaves(body)):
            # Who has sat down, or would have gone through a wall, has not gone on the way he went.
            foot = "a" if body["a_seen"] > body["b_seen"] else "b"
            body["x"], body["y"] = body[f"{foot}x"], body[f"{foot}y"]
            if seated:
                body["x"], body["y"] = self._where.seats.into(float(body["x"]), float(body["y"]), _DEEP_M)
        elif body["seen"] - body["rest_at"] < _RESTS_S and self._where.leaves(body):
            self._association.forget(index)
            return self._waits_or_gone(body, self.absent.turns(body), t)
        if body["seen"] == t:
            # What is seen is something else.
            self._association.decide(index)
            self.no_feet += _prints(body)
            if (new := began(self.bodies, body, thing)) >= 0:
                return self._merge(index, new, t)
            body["a_print"] = body["b_print"] = -1
            body["a_seen"] = body["b_seen"] = NEVER
            body["lone"] = body["wide"] = 0.0
            body["doubted"] = body["both"]
            body["quality"] = max(body["quality"], _DOUBTED)
        body["stale"] = CONCEALED
        if seated and body["clear"] > _CLEAR_S:
            self._association.decide(index)
            body["stale"] = SEATED
        body["vx"] = body["vy"] = 0.0
        moved: list[FloorEvent] = [Moved(t, *self._tell(index, t))] if seated else []
        return [*moved, Stale(t, int(body["label"]))]

    def _merge(self, index: int, new: int, t: float) -> list[FloorEvent]:
        """The mover at ``index`` is somewhere else, where there seemed to be a ``new`` one: his label goes."""
        seemed, seen = int(self.bodies[new]["label"]), float(self.bodies[new]["seen"])
        self._go_on(new, self.bodies[index])
        label, xy, cov = self._tell(new, t)
        vanished = Vanished(t, seemed, seen, t, into=label)
        return [vanished, Stale(t, label) if self.bodies[new]["stale"] else Moved(t, label, xy, cov)]

    def _confirm(
        self,
        index: int,
        missing: int | None,
        t: float,
        new_label: Callable[[], int],
        was_furniture: Callable[[Any], bool],
    ) -> list[FloorEvent]:
        """The mover at ``index`` is believed: who is ``missing``, if anybody is, or somebody new."""
        body = self.bodies[index]
        if self._region.polygons and self._region.distance(float(body["x"]), float(body["y"])) > _INSIDE_M:
            return []
        if body["from_furniture"] == 1 and (body["wide"] > 0.3 or body["width"] > _PIECE_M):
            # Nothing is pushed so far; it goes by itself.
            way = math.hypot(body["x"] - body["x0"], body["y"] - body["y0"])
            if way < _PUSHED_M or body["pushed"] > 0.4:
                return []
            body["from_furniture"] = -1
        elif (body["wide"] > 0.3 or is_footless(body)) and (body["pushed"] > 0.6 or was_furniture(body)):
            body["from_furniture"] = 1
            return []
        self._association.decide(index)
        robot = may_be_robot(body, self._robots)
        if robot and body["from_furniture"] == 0 and body["pushed"] < _ALONE:
            # It came by itself; whoever is beside it later does not push it.
            body["from_furniture"] = -1
        old = self._was(body, missing)
        if old is not None:
            body["confirmed"], body["robot"] = 1, old["robot"]
            self._go_on(index, old)
            label, xy, cov = self._tell(index, t)
            return [Back(t, label, xy, cov) if old["stale"] else Moved(t, label, xy, cov)]
        body["confirmed"], body["label"], body["robot"] = 1, new_label(), int(robot)
        self._association.named(index)
        hidden = (self.bodies["used"] == 1) & (self.bodies["confirmed"] == 1) & (self.bodies["stale"] != 0)
        self.absent.came(body, not hidden.any())
        if self.absent.inside(body) and not robot and not is_footless(body):
            for bodies in self._association.hypotheses:
                suspect(bodies, index, t)
        label, xy, cov = self._tell(index, t)
        return [Appeared(t, label, "mover", xy, cov, robot, float(body["first"]), (), float(body["width"]))]

    def _was(self, body: Any, missing: int | None) -> Any:
        """Who of those not seen now the new one is: who is ``missing``, if anybody is; None: somebody new."""
        if missing is None and not is_footless(body):
            scattered = self._association.scattered
            missing = self.absent.rises(self.bodies, body, scattered)
            if missing is None and (old := self.absent.find(body, scattered)) is not None:
                return old
            if missing is None:
                missing = self.absent.comes_out(self.bodies, body, scattered)
        if missing is None:
            return None
        self._association.decide(missing)
        return self.bodies[missing]

    def _is_pushed(self, body: Any, missing: int | None, legs: bool) -> bool:
        """Whether it is broader than a foot, began where nobody comes in, and somebody goes beside it.

        It is furniture, unless a robot is ``missing``; if not, he who goes beside it leaves it some time.
        """
        if body["footprint"] or (missing is not None and self.bodies[missing]["robot"]):
            return False
        broad = body["far"] > (WIDEST_LEG_M if legs else _SHOES_M)
        return bool(broad and body["pushed"] > _PUSHED and self.absent.inside(body))

    def _go_on(self, index: int, old: Any) -> None:
        """The mover at ``index`` is who the ``old`` body was, which is no more."""
        body = self.bodies[index]
        for field in (*OWN, "label", "first"):
            body[field] = old[field]
        old["used"] = 0
        self._association.named(index, _xy(old))

    def _tell(self, index: int, t: float) -> tuple[int, tuple[float, float], Covariance]:
        """(label, place, covariance) of the mover, which is told now."""
        label, x, y, variance = tell(self.bodies, index, t)
        return label, (x, y), (variance, 0.0, variance)


def _prints(body: Any) -> list[int]:
    return [int(body[foot]) for foot in ("a_print", "b_print") if body[foot] >= 0]


def _xy(body: Any) -> tuple[float, float]:
    return float(body["x"]), float(body["y"])


def _label(body: Any, t: float) -> FloorLabel:
    x, y, variance = place(body, t)
    return FloorLabel(
        int(body["label"]),
        "mover",
        (x, y),
        (variance, 0.0, variance),
        float(body["first"]),
        float(body["seen"]),
        None if body["stale"] else (float(body["vx"]), float(body["vy"])),
        bool(body["robot"]),
        bool(body["stale"]),
    )
