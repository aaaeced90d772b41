"""A robot with its hands: what happens in each of them, as observations of one agent.

Pure. The robot's body is a label of kind ``mover``; what a hand holds has a label of kind ``robot``. Observations of
one message come in the order of one instant: body, then hands.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from tms_agents.hand.events import Carried, Dropped, Grasped, GraspEvent, Identified, Released, Unread, gap
from tms_agents.hand.fingers import Grip
from tms_agents.hand.grasp import Grasp
from tms_agents.hand.posture import Posture
from tms_agents.hand.settings import GraspSettings
from tms_agents.hand.states import GripperMessage, StateMessage
from tms_agents.hand.surfaces import Surfaces
from tms_client.grasping import Gripper, Table
from tms_schemas.events import Placed
from tms_schemas.observation import (
    Inventory,
    InventoryLabel,
    LabelVanished,
    Observation,
    PoseReport,
    Transfer,
)

#: Two hands nearer than this may hold the same thing; further apart than the second they hold two.
_TOGETHER_M, _APART_M = 0.3, 0.6
_TAG = re.compile("[A-Z0-9._:-]{1,64}")
#: Readers and robot deliver out of order by less than this; more is a clock that was set.
_CLOCK_STEP_S = 2.0
#: The body is told again after moving or turning this much, and not sooner than this.
_BODY_M, _BODY_RAD, _BODY_S = 0.1, 0.2, 0.5


@dataclass
class _Hand:
    grasp: Grasp
    gripper: Gripper
    #: The last message about it: what a message leaves out is as before.
    said: GripperMessage | None = None
    #: The hand whose thing this one closed on: told when that one lets go, or when the two part.
    shares: str | None = None


class Robot:
    """
    Args:
        hands: settings by name of the hand.
        posture: where the grippers are.
        new_label: gives label ids that the agent never used.
        surfaces: what is under a gripper; may be exchanged when the room changes.
        tells_body: the agent posts the robot's body as a mover.
    """

    def __init__(
        self,
        hands: Mapping[str, GraspSettings],
        posture: Posture,
        new_label: Callable[[], str],
        surfaces: Surfaces,
        *,
        tells_body: bool = True,
    ) -> None:
        table = Table()
        self.surfaces = surfaces
        self._posture, self._new_label, self._tells_body = posture, new_label, tells_body
        self._hands = {
            name: _Hand(Grasp(settings), Gripper(new_label, step_m=0.0, table=table))
            for name, settings in hands.items()
        }
        self._newest = float("-inf")
        self._set_back = 0.0  # seconds by which the clock was set back since the start
        self._body: str | None = None
        self._body_told: tuple[datetime, tuple[float, float, float]] | None = None

    # inputs; ``at`` is UTC

    def message(self, at: datetime, message: StateMessage) -> list[Observation]:
        """What the robot tells of itself. Grippers that are not ours are left alone."""
        self._posture.update(message)
        found = self._move_body(at)
        for name, hand in self._hands.items():
            hand.said = message.gripper.get(name, hand.said)
            hand.grasp.but = self._tags_elsewhere(name)
            if hand.said is not None:
                spot = self._posture.spot(name, hand.said)
                before = hand.grasp.phase
                events = hand.grasp.grip(self._seconds(at), _grip(hand.said), spot)
                if hand.grasp.phase == "holding" and before in ("closed", "empty"):
                    hand.shares = self._giver(name)
                found += self._tell(name, at, events)
        return found + self._part(at)

    def read(self, hand: str, at: datetime, tag: str) -> list[Observation]:
        """The reader at a hand reads a tag; what the wire cannot carry is none."""
        if not _TAG.fullmatch(tag):
            return []
        return self._tell(hand, at, self._hands[hand].grasp.read(self._seconds(at), tag))

    def round_end(self, hand: str, at: datetime) -> list[Observation]:
        """The reader at a hand has been asked for all its tags."""
        return self._tell(hand, at, self._hands[hand].grasp.round_end(self._seconds(at)))

    def reader(self, hand: str, at: datetime, alive: bool) -> None:
        """The reader at a hand delivers, or not."""
        self._hands[hand].grasp.reader(self._seconds(at), alive)

    def interrupted(self) -> None:
        """The robot tells nothing at present."""
        for hand in self._hands.values():
            hand.said = None
            hand.grasp.interrupted()

    # answers

    def holds(self, tag: str) -> bool:
        """A hand holds the thing with this tag for certain."""
        return any(hand.grasp.told and hand.grasp.tag == tag for hand in self._hands.values())

    def inventory(self, at: datetime) -> Inventory:
        """All labels of the agent now: its body, what its hands hold, and what they put down."""
        labels: dict[str, InventoryLabel] = {}
        if self._body is not None and self._body_told is not None:
            x, y, _ = self._body_told[1]
            labels[self._body] = InventoryLabel(label=self._body, kind="mover", xy=(x, y))
        for hand in self._hands.values():
            labels |= {one.label: one for one in hand.gripper.labels()}
        return Inventory(seq=0, observed_at=at, labels=list(labels.values()))

    def to_dict(self) -> dict[str, Any]:
        """State that survives a restart, JSON types."""
        told = self._body_told
        return {
            "hands": {
                name: {"gripper": hand.gripper.to_dict(), "tag": hand.grasp.tag} for name, hand in self._hands.items()
            },
            "body": None if self._body is None or told is None else [self._body, told[0].isoformat(), list(told[1])],
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue where ``to_dict`` was; hands that are no longer configured are left out.

        Raises:
            ValueError: it is no such state.
        """
        try:
            for name, kept in state["hands"].items():
                if name in self._hands:
                    hand = self._hands[name]
                    hand.gripper.restore(kept["gripper"])
                    if hand.gripper.held is not None:
                        hand.grasp.restore(kept["tag"])
            if state["body"] is not None:
                label, at, (x, y, theta) = state["body"]
                self._body, self._body_told = str(label), (datetime.fromisoformat(at), (x, y, theta))
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"not the state of a robot's hands: {error!r}") from error

    def _seconds(self, at: datetime) -> float:
        """Time as the hands know it: it goes on where the clock is set back."""
        seconds = at.timestamp() + self._set_back
        if seconds < self._newest - _CLOCK_STEP_S:
            self._set_back += self._newest - seconds
            seconds = self._newest
        self._newest = max(self._newest, seconds)
        return seconds

    # what is told

    def _tell(self, name: str, at: datetime, events: list[GraspEvent]) -> list[Observation]:
        return [observation for event in events for observation in self._one(name, at, event)]

    def _one(self, name: str, at: datetime, event: GraspEvent) -> list[Observation]:
        hand = self._hands[name]
        gripper, when = hand.gripper, datetime.fromtimestamp(event.at - self._set_back, at.tzinfo)
        before: list[Observation] = []
        if hand.shares is not None:
            if not self._splits(hand, event):
                if isinstance(event, Released | Dropped):
                    hand.shares = None
                return []
            before = self._own(hand, at)
        match event:
            case Grasped(spot=spot, tag=tag):
                return before + gripper.grasped(when, spot.xy, tag=tag, z=spot.z, cov=spot.cov)
            case Identified(tag=tag):
                return before + gripper.read(when, tag)
            case Unread():
                return before + gripper.missed(when)
            case Carried(spot=spot):
                return before + gripper.moved(when, spot.xy, spot.z, spot.cov)
            case Released() | Dropped() if (taker := self._taker(name)) is not None:
                return self._pass_on(hand, taker, at)
            case Released(spot=spot):
                below = self.surfaces.under(spot)
                if below.onto == "person":
                    return gripper.dropped(when, spot.xy)
                found = gripper.released(
                    when, spot.xy, kind=below.onto, watched=below.watched,
                    surface=below.surface, z=below.z, cov=spot.cov,
                )  # fmt: skip
                return [self._with_the_robot(one) for one in found]
            case Dropped(spot=place):
                return gripper.dropped(when, None if place is None else place.xy)

    def _with_the_robot(self, observation: Observation) -> Observation:
        """What the robot puts where a sensor sees it goes through nobody else's hands."""
        if isinstance(observation, LabelVanished) and self._body is not None:
            return observation.model_copy(update={"dest": self._body})
        return observation

    # two hands, one thing

    def _giver(self, name: str) -> str | None:
        """The hand whose thing this one has just closed on."""
        own = self._hands[name].grasp.spot
        for other, hand in self._hands.items():
            if other == name or hand.gripper.held is None or own is None or hand.grasp.spot is None:
                continue
            if gap(own, hand.grasp.spot) <= _TOGETHER_M:
                return other
        return None

    def _splits(self, hand: _Hand, event: GraspEvent) -> bool:
        """The event shows that this hand holds a thing of its own, with another tag."""
        assert hand.shares is not None
        tag = self._hands[hand.shares].grasp.tag
        return isinstance(event, Grasped | Identified) and None not in (tag, event.tag) and event.tag != tag

    def _taker(self, giver: str) -> _Hand | None:
        """The hand that has closed on what this one lets go."""
        hands = self._hands.values()
        return next((one for one in hands if one.shares == giver and one.grasp.phase == "holding"), None)

    def _pass_on(self, giver: _Hand, taker: _Hand, at: datetime) -> list[Observation]:
        """From one hand to the other: a transfer, so that the object goes along whatever it is."""
        held, spot = giver.gripper.held, taker.grasp.spot
        taker.shares, giver.gripper.held = None, None
        if held is None:
            return []
        xy, z, cov = (held.xy, held.z, None) if spot is None else (spot.xy, spot.z, spot.cov)
        new = held.model_copy(update={"label": self._new_label(), "xy": xy, "z": z})
        taker.gripper.held = new
        taker.grasp.adopt(self._seconds(at), new.tag)
        place = Placed(xy=xy, z=z, cov=cov).model_dump(exclude_none=True)
        return [Transfer(seq=0, observed_at=at, from_=held.label, to=new.label, kind="robot", **place)]

    def _part(self, at: datetime) -> list[Observation]:
        """Hands that went apart while both are closed hold two things; a hand that opened shares nothing."""
        found: list[Observation] = []
        for hand in self._hands.values():
            if hand.shares is None:
                continue
            giver = self._hands[hand.shares]
            if hand.grasp.phase not in ("holding", "opened"):
                hand.shares = None
            elif giver.gripper.held is None or gap(hand.grasp.spot, giver.grasp.spot) > _APART_M:
                found += self._own(hand, at)
        return found

    def _own(self, hand: _Hand, at: datetime) -> list[Observation]:
        """What this hand closed on is a thing of its own after all."""
        hand.shares = None
        spot = hand.grasp.spot
        if not hand.grasp.told or spot is None:  # then it is told when it is lifted
            return []
        return hand.gripper.grasped(at, spot.xy, tag=hand.grasp.tag, z=spot.z, cov=spot.cov)

    def _tags_elsewhere(self, name: str) -> frozenset[str]:
        """Tags that other hands hold, and not near this one."""
        own = self._hands[name].grasp.spot
        return frozenset(
            hand.grasp.tag
            for other, hand in self._hands.items()
            if other != name and hand.grasp.told and hand.grasp.tag is not None
            if gap(own, hand.grasp.spot) > _TOGETHER_M
        )

    # the body

    def _move_body(self, at: datetime) -> list[Observation]:
        base = self._posture.base
        if base is None or not self._tells_body:
            return []
        if self._body is not None and self._body_told is not None:
            told_at, told = self._body_told
            turned = abs(math.remainder(base[2] - told[2], math.tau))
            near = math.dist(base[:2], told[:2]) < _BODY_M and turned < _BODY_RAD
            if near or (at - told_at).total_seconds() < _BODY_S:
                return []
        if self._body is None:
            self._body = self._new_label()
        self._body_told = (at, base)
        return [PoseReport(seq=0, observed_at=at, label=self._body, pose=base)]


def _grip(message: GripperMessage) -> Grip:
    return Grip(closed=message.closed, opening_m=message.opening_m, effort=message.effort)
