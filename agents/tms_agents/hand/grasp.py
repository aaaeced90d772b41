"""One hand: from finger states, tag reads and poses to grasped, carried, put down, lost.

Pure; times are seconds that never go back. At most one thing is in the hand; everything that was ``Grasped`` is
``Released`` or ``Dropped`` exactly once.

  open --fingers close--> closed --something between them--> holding --fingers open--> opened --gone--> open
                             |                                 |  ^                       |
                             +--nothing between them--> empty <-+  +--closed on it again--+

* A thing counts as grasped when it is lifted; a grip that is loosened where it was closed has moved nothing.
* A fall is told only where the fingers have met *and* the tag is read no more (or nothing can read it). One missed look
  is nothing. Where no sensor of the fingers tells, a tag that is lost for long shows at the next opening that the thing
  had gone before.
* Until an opening is known to be a release, closing again on the thing continues the same grasp.
"""

from __future__ import annotations

from typing import Literal

from tms_agents.hand.events import Carried, Dropped, Grasped, GraspEvent, Identified, Released, Spot, Unread, gap
from tms_agents.hand.evidence import TagEvidence
from tms_agents.hand.fingers import Fingers, Grip
from tms_agents.hand.looks import Looks
from tms_agents.hand.settings import GraspSettings

Phase = Literal["open", "closed", "holding", "empty", "opened"]

#: Looks without any tag after which the thing counts as unreadable.
_UNREAD_LOOKS = 5
#: Looks without the tag that show that it stayed behind, and with it that it came along, when an open hand left.
_LEFT_LOOKS, _STUCK_LOOKS = 2, 3
#: A hand this many times ``lift_m`` away no longer reads what it put down.
_FAR = 4


class Grasp:
    """One hand. Feed it in order of time; each call returns what became certain by it."""

    def __init__(self, settings: GraspSettings | None = None) -> None:
        self.settings = settings or GraspSettings()
        self.phase: Phase = "open"
        #: A thing was told to be in the hand, and its tag as far as it is certain.
        self.told = False
        self.tag: str | None = None
        #: Tags that are certain to be elsewhere (in another hand of the robot).
        self.but: frozenset[str] = frozenset()
        self.spot: Spot | None = None
        self._fingers = Fingers(self.settings.fingers)
        self._evidence = TagEvidence(self.settings.reads)
        self._t = float("-inf")
        self._grip_at = float("-inf")
        self._unsure = False  # nobody knows what the hand did since the last message
        self._since = float("-inf")  # of the present phase
        self._place: Spot | None = None  # where the present phase began
        self._anchor: Spot | None = None  # where the present place of the looks is
        self._lifted: tuple[float, Spot] | None = None
        self._last_told: tuple[float, Spot] | None = None
        self._looks = Looks(self.settings.look_s)
        self._met: Spot | None = None  # where the fingers met while holding
        self._last_read = float("-inf")
        self._hits = self._misses = 0  # looks in a row that showed the tag, or did not

    # inputs

    def grip(self, t: float, grip: Grip, spot: Spot | None) -> list[GraspEvent]:
        """A message about the gripper, and where it is (None: not known now)."""
        t = self._forward(t)
        self.spot = spot
        if t - self._grip_at > self.settings.gap_s:
            self._unsure = True
        self._grip_at = t
        self._fingers.update(t, grip)
        self._note_place()
        found = self._end_look(t) + self._step(t)
        self._unsure = False
        return found

    def read(self, t: float, tag: str) -> list[GraspEvent]:
        """The reader at the hand reads ``tag``."""
        t = self._forward(t)
        found = self._end_look(t)
        self._looks.read(t, tag)
        return found

    def round_end(self, t: float) -> list[GraspEvent]:
        """The reader has been asked for all tags and has told them."""
        t = self._forward(t)
        return self._looked(t, self._looks.round_end(t))

    def reader(self, t: float, alive: bool) -> None:
        """The reader delivers, or not."""
        if self._looks.reader(self._forward(t), alive):
            self._hits = self._misses = 0

    def interrupted(self) -> None:
        """Messages of the gripper stopped: what it does until the next one is not known."""
        self._unsure = True

    def restore(self, tag: str | None) -> None:
        """A thing was in the hand when the agent ended."""
        self.phase, self.told, self.tag, self._unsure = "holding", True, tag, True
        self._fingers.closed = True

    def adopt(self, t: float, tag: str | None) -> None:
        """What the hand holds was told already, with this tag: it came from another hand."""
        self.told, self.tag = True, tag
        self._last_read, self._hits, self._misses = t, 0, 0
        self._last_told = None

    def forget(self) -> None:
        """What was told to be in this hand is told by another one."""
        self.told, self.tag = False, None

    # phases

    def _step(self, t: float) -> list[GraspEvent]:
        match self.phase:
            case "open" | "empty" | "closed":
                return self._may_close(t)
            case "holding":
                return self._while_holding(t)
            case "opened":
                return self._while_opened(t)

    def _may_close(self, t: float) -> list[GraspEvent]:
        fingers = self._fingers
        if not fingers.closed:
            self._enter("open", t)
        elif self.phase == "open":
            self._enter("closed", t)
            self._begin()
        elif fingers.settled(t, self.settings.settle_s):
            if fingers.holds is False:
                self._enter("empty", t)
            elif fingers.holds or self._sure_tag() is not None:
                place = self._place
                self._enter("holding", t)
                self._place = place  # where the fingers closed
        return self._while_holding(t) if self.phase == "holding" else []

    def _while_holding(self, t: float) -> list[GraspEvent]:
        if not self._fingers.closed:
            return self._opens(t)
        if self._fingers.holds is False:
            self._met = self._met or self.spot
            return self._may_have_dropped(t)
        self._met = None
        found = self._tell(t)
        if self.told and not self._suspicious():
            found += self._carry(t)
        return found

    def _opens(self, t: float) -> list[GraspEvent]:
        gone_before = self._fingers.holds is None and self._tag_lost(t)
        if self.told and (self._unsure or gone_before):
            return self._lose(t if self._unsure else self._last_read, None, "open", t)
        found: list[GraspEvent] = []
        if not self.told and self._lifted is not None:
            found = [self._grasped(t)]
        if not self.told:
            self._enter("open", t)
            return found
        self._enter("opened", t)
        self._hits = self._misses = 0
        return found

    def _may_have_dropped(self, t: float) -> list[GraspEvent]:
        """The fingers have met."""
        since, settings = max(self._fingers.holds_since, self._since), self.settings
        if t - since < settings.drop_s:
            return []
        if not self.told:
            found: list[GraspEvent] = [] if self._lifted is None else [self._grasped(t), Dropped(since, self._met)]
            self._enter("empty", t)
            self._begin()
            return found
        if self.tag is not None and self._looks.alive:
            # A tag that was read after the fingers met is of something thin: then it takes more to say that it fell.
            thin = self._last_read > since + settings.drop_s
            if self._misses < settings.drop_looks * (4 if thin else 1):
                return self._carry(t) if thin and self._hits else []
        elif self.tag is not None and t - since < 4 * settings.drop_s:
            return []
        return self._lose(since, None if self._unsure else self._met, "empty", t)

    def _while_opened(self, t: float) -> list[GraspEvent]:
        """The hand opened at ``_place`` at ``_since``."""
        settings, fingers = self.settings, self._fingers
        away = gap(self.spot, self._place)
        if fingers.closed:
            if not fingers.settled(t, settings.settle_s):
                return []
            again = fingers.holds
            if again is None and self.tag is not None and self._looks.alive:
                if self._hits == 0 and self._misses < settings.drop_looks:
                    return []
                again = self._hits > 0
            if again is not False:
                self._enter("holding", t)
                return []
            return self._release("closed", t)
        if self.tag is None or not self._looks.alive:
            left = away > settings.lift_m
        elif away > _FAR * settings.lift_m and self._hits >= _STUCK_LOOKS:
            # An open hand far away that still reads it has it with it: told on, until it is read no more.
            self._since = t
            return self._carry(t)
        else:
            left = away > settings.lift_m and self._misses >= _LEFT_LOOKS
        if left or (t - self._since >= settings.release_s and away <= _FAR * settings.lift_m):
            return self._release("open", t)
        if t - self._since >= settings.lost_s:
            return self._lose(t, None, "open", t)
        return []

    # what is told

    def _tell(self, t: float) -> list[GraspEvent]:
        """The grasp when it is lifted, with its tag where that is certain; later the tag."""
        if self._lifted is None and self.spot is not None:
            far = gap(self.spot, self._place) > self.settings.lift_m
            if far or t - self._since > self.settings.hold_s:
                self._lifted = (t, self.spot)
        sure = self._sure_tag()
        if self.told:
            if sure is not None and sure != self.tag:
                self.tag, self._last_read, self._misses = sure, t, 0
                return [Identified(t, sure)]
            return []
        if self._lifted is None or (
            sure is None and self._looks.alive and t - self._lifted[0] < self.settings.tag_wait_s
        ):
            return []
        found: list[GraspEvent] = [self._grasped(t)]
        if (
            self.tag is None
            and self._looks.alive
            and self._evidence.looks >= _UNREAD_LOOKS
            and not self._evidence.seen_any()
        ):
            found.append(Unread(t))
        return found

    def _grasped(self, t: float) -> Grasped:
        assert self._lifted is not None
        at, spot = self._lifted
        self.told, self.tag = True, self._sure_tag()
        self._last_told, self._last_read, self._misses = (at, spot), t, 0
        return Grasped(at, spot, self.tag)

    def _carry(self, t: float) -> list[GraspEvent]:
        if self.spot is None:
            return []
        if self._last_told is not None:
            at, spot = self._last_told
            if t - at < self.settings.step_s or gap(self.spot, spot) < self.settings.step_m:
                return []
        self._last_told = (t, self.spot)
        return [Carried(t, self.spot)]

    def _release(self, phase: Phase, t: float) -> list[GraspEvent]:
        spot, at = self._place, self._since
        self._enter(phase, t)
        self._begin()
        return [Released(at, spot) if spot is not None else Dropped(at, None)]

    def _lose(self, at: float, spot: Spot | None, phase: Phase, t: float) -> list[GraspEvent]:
        self._enter(phase, t)
        self._begin()
        return [Dropped(at, spot)]

    def _begin(self) -> None:
        """Whatever comes into the hand next is another thing."""
        self.forget()
        self._evidence.begin()
        self._anchor, self._lifted, self._met = self.spot, None, None

    # looks

    def _end_look(self, t: float) -> list[GraspEvent]:
        tags = self._looks.ended(t)
        return [] if tags is None else self._looked(t, tags)

    def _looked(self, t: float, tags: frozenset[str]) -> list[GraspEvent]:
        if self.tag is not None:
            read = self.tag in tags
            self._last_read = t if read else self._last_read
            self._hits, self._misses = (self._hits + 1, 0) if read else (0, self._misses + 1)
        if self._fingers.closed and self.phase in ("closed", "holding"):
            self._evidence.look(tags)
            if self.phase == "holding" and self._fingers.holds is not False:
                return self._tell(t)
        return []

    def _note_place(self) -> None:
        if self.spot is None:
            return
        if self._anchor is None:
            self._anchor = self.spot
        elif gap(self.spot, self._anchor) > self.settings.place_m:
            self._anchor = self.spot
            self._evidence.elsewhere()

    def _sure_tag(self) -> str | None:
        tag, probability = self._evidence.best(self.but)
        return tag if probability >= self.settings.sure else None

    def _tag_lost(self, t: float) -> bool:
        lost = self._misses > self.settings.drop_looks and t - self._last_read > self.settings.lost_s
        return self.tag is not None and self._looks.alive and lost

    def _suspicious(self) -> bool:
        """It may be gone: where the hand goes is not where the thing is."""
        return self._fingers.holds is None and self.tag is not None and self._misses >= self.settings.drop_looks

    def _enter(self, phase: Phase, t: float) -> None:
        if phase != self.phase:
            self.phase, self._since, self._place = phase, t, self.spot

    def _forward(self, t: float) -> float:
        self._t = max(self._t, t)
        return self._t
