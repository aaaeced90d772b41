"""Who said what of what happened: detections of a contestant matched with the truth, episode by episode.

A detection counts only in the episode (a change, or two at once, and the rest that follows) in which it was made, and
only for the right stay: "out" of another thing is a miss and a false alarm. Positions must be within ``position_gate``.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from dataclasses import dataclass, field

import numpy as np
from cabinet_contestants import Contestant, Detection, Xy
from cabinet_limits import position_limit

from tms_agents.simulation.board import BoardWorld, Change
from tms_agents.simulation.board_life import Episode

KINDS = ("in", "out", "move", "identified")
#: Half the width of a household thing: nearer than this is right whatever the noise allows.
NEAR_M = 0.05


def position_gate(world: BoardWorld, change: Change) -> float:
    """How far from the truth a position may be: ``NEAR_M`` and thrice what one second of samples must leave unknown."""
    p = world.parameters.electronics
    variance = p.noise_sd_g**2 + p.gram_per_count**2 / 12
    samples = 1.0 / world.parameters.period_s
    return NEAR_M + 3 * position_limit(world.shares, change.weight_g, change.xy, variance / samples * 2)


@dataclass
class Scores:
    """Counts by (situation, kind); the situations are "single", "pair", "lean" and "rest" (nothing happened)."""

    found: Counter[tuple[str, str]] = field(default_factory=Counter)
    missed: Counter[tuple[str, str]] = field(default_factory=Counter)
    false: Counter[tuple[str, str]] = field(default_factory=Counter)
    unpinned: int = 0  # of the found: declared as one load over several stays, position not asked for
    reentered: int = 0  # lifted moves that were told as out and in
    untagged: int = 0  # of the missed "in": no tag
    #: At the end of every rest: things on the board, of these in their places, of the tagged ones there also named,
    #: and stays without a thing.
    things: int = 0
    placed: int = 0
    tagged: int = 0
    named: int = 0
    phantoms: int = 0
    latency_s: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    examples: list[str] = field(default_factory=list)

    def add(self, other: Scores) -> None:
        self.found += other.found
        self.missed += other.missed
        self.false += other.false
        self.unpinned += other.unpinned
        self.reentered += other.reentered
        self.untagged += other.untagged
        for count in ("things", "placed", "tagged", "named", "phantoms"):
            setattr(self, count, getattr(self, count) + getattr(other, count))
        for kind, values in other.latency_s.items():
            self.latency_s[kind] += values
        self.examples += other.examples

    def recall(self, kind: str | None = None, situation: str | None = None) -> float:
        found, missed = _sum(self.found, kind, situation), _sum(self.missed, kind, situation)
        return found / (found + missed) if found + missed else math.nan

    def precision(self, kind: str | None = None, situation: str | None = None) -> float:
        found, false = _sum(self.found, kind, situation), _sum(self.false, kind, situation)
        return found / (found + false) if found + false else math.nan


class Referee:
    """Follows one contestant through one world."""

    def __init__(self, world: BoardWorld, contestant: Contestant) -> None:
        self.scores = Scores()
        self._world, self._contestant = world, contestant
        self._stay: dict[str, str] = {}  # name of a thing on the board -> the contestant's stay
        self._on_board: dict[str, Change] = {}
        self._to_identify: dict[str, tuple[str, float, str]] = {}  # stay -> (tag, since when it could be, situation)
        self._identified: set[str] = set()
        self._told_xy: dict[str, Xy] = {}  # where each stay was told last, before this episode

    def judge(self, episode: Episode, said: list[Detection]) -> None:
        self._situation = _situation(episode)
        self._left = list(said)
        self._shared = {stay for one in said if one.kind == "unpinned" for stay in one.group}
        self._left = [one for one in self._left if one.kind != "unpinned"]
        self._refine()
        changes = [change for change in episode.changes if change.kind != "lean"]
        self._outs([change for change in changes if change.kind == "out"])
        moves = [change for change in changes if change.kind == "move"]
        lifted = self._moves(moves)
        self._ins([change for change in changes if change.kind == "in"] + lifted)
        self._identities(episode)
        self._leftovers(changes)
        self._told_xy.update(self._last_xy)
        self._compare()

    def _refine(self) -> None:
        """A stay that appeared and was then told more precisely stands where it was told last."""
        self._last_xy: dict[str, Xy] = {
            one.stay: one.xy for one in self._left if one.kind in ("in", "move") and one.xy is not None
        }
        born = {one.stay for one in self._left if one.kind == "in"}
        self._left = [one for one in self._left if not (one.kind == "move" and one.stay in born)]

    def _outs(self, changes: list[Change]) -> None:
        for change in changes:
            stay = self._stay.pop(change.name, None)
            self._on_board.pop(change.name, None)
            self._note(change, "out", self._take("out", stay), change.stable)
            if stay is not None:
                self._to_identify.pop(stay, None)

    def _moves(self, changes: list[Change]) -> list[Change]:
        """Moves told as such; returns the lifted ones that may have been told as out and in."""
        others = []
        for change in changes:
            self._on_board[change.name] = change
            stay = self._stay.get(change.name)
            near = [
                one
                for one in self._left
                if one.kind == "move" and one.stay == stay and self._near(change, self._last_xy[one.stay])
            ]
            if near:
                self._note(change, "move", near[-1], change.stable)
                self._left = [one for one in self._left if not (one.kind == "move" and one.stay == stay)]
            elif change.lifted is not None and (gone := self._take("out", stay)) is not None:
                others.append(change)
                self._stay.pop(change.name)
                self._to_identify.pop(gone.stay, None)
            else:
                self._note(change, "move", None, change.stable)
        return others

    def _ins(self, changes: list[Change]) -> None:
        for change in changes:
            self._on_board[change.name] = change
        pairs = sorted(
            (self._likeness(change, one), i, j)
            for i, change in enumerate(changes)
            for j, one in enumerate(self._left)
            if one.kind == "in"
        )
        taken: dict[int, int] = {}
        for apart, i, j in pairs:
            one = self._left[j]
            allowed = self._shared_in(one) or apart[1] <= position_gate(self._world, changes[i])
            right_tag = not self._contestant.by_tag or one.stay == changes[i].tag
            if i not in taken and j not in taken.values() and allowed and right_tag:
                taken[i] = j
        for i, change in enumerate(changes):
            one_or_none = self._left[taken[i]] if i in taken else None
            self._note(change, "in" if change.kind == "in" else "move", one_or_none, change.stable)
            if change.kind == "move" and one_or_none is not None:
                self.scores.reentered += 1
            if one_or_none is not None:
                self.scores.unpinned += self._shared_in(one_or_none)
                self._stay[change.name] = one_or_none.stay
            elif self._contestant.by_tag and change.tag is not None:
                self._stay[change.name] = change.tag
            if change.tag is not None:
                stay = self._stay.get(change.name, f"never seen {change.name} {change.start}")
                self._to_identify[stay] = (change.tag, change.stable, self._situation)
                self._identified.discard(stay)
        used = set(taken.values())
        self._left = [one for j, one in enumerate(self._left) if j not in used]

    def _identities(self, episode: Episode) -> None:
        rest = []
        for one in self._left:
            if one.kind != "identified":
                rest.append(one)
                continue
            due = self._to_identify.get(one.stay)
            if due is not None and due[0] == one.tag:
                del self._to_identify[one.stay]
                self._identified.add(one.stay)
                self.scores.found[due[2], "identified"] += 1
                self.scores.latency_s["identified"].append(one.at - due[1])
            elif one.stay not in self._identified:
                rest.append(one)
        self._left = rest
        # What has not been identified until the next thing happens is missed.
        for stay, (tag, _, situation) in self._to_identify.items():
            self.scores.missed[situation, "identified"] += 1
            self._example(f"{situation}: {tag} of stay {stay} not identified")
        self._identified.update(self._to_identify)
        self._to_identify.clear()

    def _leftovers(self, changes: list[Change]) -> None:
        names = {stay: name for name, stay in self._stay.items()}
        touched = {change.name for change in changes}
        for one in self._left:
            name = names.get(one.stay)
            told_better = name is not None and one.xy is not None and self._near(self._on_board[name], one.xy)
            before = self._told_xy.get(one.stay)
            no_news = before is not None and one.xy is not None and math.dist(before, one.xy) <= NEAR_M
            if one.kind == "move" and (name in touched or told_better or no_news):
                continue  # also what is told on the way, and what stands where it stood, right or wrong
            self.scores.false[self._situation, one.kind] += 1
            self._example(f"{self._situation}: false {one.kind} of stay {one.stay} ({name}) at {one.at:.2f} {one.xy}")

    def _compare(self) -> None:
        """What stands on the board with what the contestant holds to stand there, nearest first."""
        standing = self._contestant.standing()
        stays = dict(standing)
        pairs = sorted(
            (math.dist(thing.xy, xy), name, stay)
            for name, thing in self._on_board.items()
            for stay, (xy, _) in stays.items()
        )
        left = dict(self._on_board)
        for apart, name, stay in pairs:
            if name in left and stay in stays and apart <= position_gate(self._world, left[name]):
                thing = left.pop(name)
                _, tag = stays.pop(stay)
                held = standing.get(self._stay.get(name, ""))
                elsewhere = held is None or not self._near(thing, held[0])
                if elsewhere and not self._contestant.by_tag and stay not in self._stay.values():
                    # Put right after a false alarm and a miss that have been counted, also where a part of what the
                    # thing was held for is still held to be somewhere else.
                    self._stay[name] = stay
                self.scores.placed += 1
                self.scores.named += thing.tag is not None and tag == thing.tag
        self.scores.things += len(self._on_board)
        self.scores.tagged += sum(thing.tag is not None for thing in self._on_board.values())
        self.scores.phantoms += len(stays)

    def _note(self, change: Change, kind: str, one: Detection | None, due: float) -> None:
        if one is None:
            self.scores.missed[self._situation, kind] += 1
            self.scores.untagged += change.tag is None
            self._example(
                f"{self._situation}: missed {kind} of {change.name} {change.weight_g:.0f} g "
                f"{'tagged' if change.tag else 'untagged'} {change.start:.2f}-{change.stable:.2f} {change.xy}"
                f"{' lifted' if change.lifted else ''}"
            )
        else:
            self.scores.found[self._situation, kind] += 1
            self.scores.latency_s[kind].append(one.at - due)

    def _take(self, kind: str, stay: str | None) -> Detection | None:
        for i, one in enumerate(self._left):
            if one.kind == kind and one.stay == stay:
                return self._left.pop(i)
        return None

    def _near(self, change: Change, xy: Xy) -> bool:
        return math.dist(change.xy, xy) <= position_gate(self._world, change)

    def _distance(self, change: Change, one: Detection) -> float:
        return math.dist(change.xy, self._last_xy[one.stay])

    def _likeness(self, change: Change, one: Detection) -> tuple[int, float]:
        """Nearest first; of stays that share one load, which have no place of their own, those with the right tag."""
        tag = next((other.tag for other in self._left if other.kind == "identified" and other.stay == one.stay), None)
        wrong = 0 if tag == change.tag or not self._shared_in(one) else 1 if tag is None else 2
        return (wrong, self._distance(change, one))

    def _shared_in(self, one: Detection) -> bool:
        return one.stay in self._shared

    def _example(self, text: str) -> None:
        if len(self.scores.examples) < 400:
            self.scores.examples.append(text)


def _situation(episode: Episode) -> str:
    if not episode.changes:
        return "rest"
    if episode.changes[0].kind == "lean":
        return "lean"
    return "pair" if len(episode.changes) > 1 else "single"


def _sum(counts: Counter[tuple[str, str]], kind: str | None, situation: str | None) -> int:
    return sum(
        n for (s, k), n in counts.items() if (kind is None or k == kind) and (situation is None or s == situation)
    )


def percentiles(values: list[float]) -> tuple[float, float, float]:
    """p50, p95 and the largest."""
    if not values:
        return (math.nan, math.nan, math.nan)
    return (float(np.percentile(values, 50)), float(np.percentile(values, 95)), float(np.max(values)))
