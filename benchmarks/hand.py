"""How often the hand agent is right: simulated fetches from a crowded shelf to a crowded table.

    python benchmarks/hand.py [--runs 500] [--seed 0]

One run: a hand reaches among the things of a shelf, closes on one of them (or on nothing), lifts it, carries it 1.5 m
to a table with other things, and puts it down. On the way it may be loosened and gripped again, the thing may fall, and
its tag may be shaded for seconds. Every tag within the reader's range is read in a round with 1 - MISS, whether it is
in the hand or a neighbour. One thing in ten has no readable tag. The estimator knows nothing of all this but its
inputs, and its settings are the defaults.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from tms_agents.hand.events import Carried, Dropped, Grasped, GraspEvent, Identified, Released, Spot
from tms_agents.hand.fingers import Grip
from tms_agents.hand.grasp import Grasp

STEP_S, ROUND_STEPS = 0.05, 4
WIDE, FIELD_M = 0.1, 0.25


class Case(NamedTuple):
    name: str
    neighbours: int
    miss: float
    p_shade: float = 0.0
    p_fall: float = 0.0


CASES = (
    Case("alone, 20 % missed", 0, 0.2),
    Case("2 neighbours, 20 % missed", 2, 0.2),
    Case("6 neighbours, 20 % missed", 6, 0.2),
    Case("6 neighbours, 40 % missed", 6, 0.4),
    Case("6 neighbours, 20 % missed, tag shaded for 0.5 to 2 s in half the runs", 6, 0.2, p_shade=0.5),
    Case("2 neighbours, 20 % missed, a third falls", 2, 0.2, p_fall=0.33),
)


@dataclass
class Thing:
    tag: str | None
    xy: np.ndarray
    width: float


@dataclass
class Truth:
    """What really happened to the thing in the hand."""

    tag: str | None = None
    grasped: bool = False
    lifted_at: float = float("nan")
    ended: str = ""  # released or fell
    ended_at: float = float("nan")
    ended_xy: np.ndarray = field(default_factory=lambda: np.zeros(2))


class Fetch:
    """One run; ``play`` feeds a hand and returns what it told."""

    def __init__(self, case: Case, rng: np.random.Generator) -> None:
        self._case, self._rng = case, rng
        self._t = 1000.0
        self._hand = np.array([0.0, -0.5])
        self._z = 0.9
        self._opening = WIDE
        self._held: Thing | None = None
        self._shaded_until = 0.0
        self.truth = Truth()
        self._target = self._thing(np.zeros(2))
        around = [self._thing(rng.normal(0, 0.15, 2)) for _ in range(case.neighbours)]
        beyond = [self._thing(np.array([1.5, 0.0]) + rng.normal(0, 0.2, 2)) for _ in range(case.neighbours)]
        self._things = [self._target, *around, *beyond]

    def play(self, hand: Grasp) -> list[tuple[float, GraspEvent]]:
        """What the hand told, with the time when it did."""
        told: list[tuple[float, GraspEvent]] = []
        hand.reader(self._t, True)
        for n, _ in enumerate(self._story()):
            self._t += STEP_S
            events: list[GraspEvent] = []
            if n % ROUND_STEPS == 0:
                for tag in self._round():
                    events += hand.read(self._t, tag)
                events += hand.round_end(self._t)
            x, y = self._hand + self._rng.normal(0, 0.005, 2)
            grip = Grip(opening_m=max(0.0, self._opening + self._rng.normal(0, 0.0005)))
            events += hand.grip(self._t, grip, Spot((float(x), float(y)), self._z))
            told += [(self._t, one) for one in events]
        return told

    def _story(self) -> Iterator[None]:
        """One step of time per item."""
        rng, case = self._rng, self._case
        yield from self._to(np.zeros(2), 1.0)
        empty = rng.random() < 0.05
        yield from self._fingers(0.0 if empty else self._target.width)
        if empty:
            yield from self._wait(0.5)
            yield from self._fingers(WIDE)
            return
        self._held = self._target
        yield from self._wait(rng.uniform(0.3, 1.5))
        if rng.random() < 0.1:  # thinks better of it
            self._held = None
            yield from self._fingers(WIDE)
            yield from self._to(np.array([0.0, -0.5]), 1.0)
            return
        self.truth = Truth(tag=self._target.tag, grasped=True, lifted_at=self._t)
        self._z = 1.05
        falls = rng.uniform(0.3, 1.2) if rng.random() < case.p_fall else None
        if rng.random() < case.p_shade:
            self._shaded_until = self._t + rng.uniform(0.5, 2.0)
        goal = np.array([1.5, 0.0]) if falls is None else np.array([falls, 0.0])
        yield from self._to(goal, 2.5 * float(goal[0]) / 1.5)
        if falls is not None:
            self._ends("fell")
            self._target.xy = self._hand + rng.normal(0, 0.1, 2)
            yield from self._fingers(0.0)
            yield from self._to(np.array([1.5, 0.0]), 2.0)
            yield from self._wait(2.0)
            return
        if rng.random() < 0.3:  # loosened and gripped again
            yield from self._fingers(self._target.width + 0.02)
            yield from self._fingers(self._target.width)
        self._z = 0.9
        yield from self._wait(rng.uniform(0.2, 1.0))
        self._ends("released")
        self._target.xy = self._hand.copy()
        yield from self._fingers(WIDE)
        yield from self._wait(rng.uniform(0.0, 1.5))
        yield from self._to(np.array([1.5, -0.5]), 1.0)
        yield from self._wait(1.5)

    def _ends(self, how: str) -> None:
        self.truth.ended, self.truth.ended_at, self.truth.ended_xy = how, self._t, self._hand.copy()
        self._held = None

    def _to(self, goal: np.ndarray, seconds: float) -> Iterator[None]:
        start, steps = self._hand.copy(), max(1, round(seconds / STEP_S))
        for n in range(1, steps + 1):
            self._hand = start + (goal - start) * n / steps
            yield

    def _wait(self, seconds: float) -> Iterator[None]:
        for _ in range(round(seconds / STEP_S)):
            yield

    def _fingers(self, opening: float) -> Iterator[None]:
        start, steps = self._opening, 6
        for n in range(1, steps + 1):
            self._opening = start + (opening - start) * n / steps
            yield

    def _round(self) -> list[str]:
        found = []
        for thing in self._things:
            held = thing is self._held
            gap = 0.0 if held else float(np.linalg.norm(thing.xy - self._hand))
            shaded = held and self._t < self._shaded_until
            if thing.tag and gap < FIELD_M and not shaded and self._rng.random() > self._case.miss:
                found.append(thing.tag)
        return found

    def _thing(self, xy: np.ndarray) -> Thing:
        tag = None if self._rng.random() < 0.1 else f"{self._rng.integers(1 << 62):024X}"
        return Thing(tag, xy, float(self._rng.uniform(0.02, 0.07)))


def judge(
    truth: Truth, heard: list[tuple[float, GraspEvent]], score: Counter[str], late: list[float], off: list[float]
) -> None:
    """Count what was told right and wrong."""
    told = [event for _, event in heard]
    grasps = [one for one in told if isinstance(one, Grasped)]
    ends = [one for one in told if isinstance(one, Released | Dropped)]
    score["runs"] += 1
    if not truth.grasped:
        score["phantom"] += bool(grasps)
        return
    score["grasps"] += 1
    score["missed"] += not grasps
    score["more than one"] += len(grasps) > 1
    if not grasps:
        return
    names = [(t, one.tag) for t, one in heard if isinstance(one, Grasped | Identified)]
    when, tag = names[-1]
    if any(named is not None and named != truth.tag for _, named in names[:-1]):
        score["wrong for a while"] += 1
    if tag == truth.tag:
        score["right"] += 1
        if tag is not None:
            late.append(when - truth.lifted_at)
    else:
        score["no tag told" if tag is None else "wrong tag"] += 1
    if not ends:
        score["end missed"] += 1
    elif truth.ended == "fell":
        score["falls"] += 1
        score["falls seen"] += isinstance(ends[0], Dropped) and abs(ends[0].at - truth.ended_at) < 1.0
    else:
        score["put downs"] += 1
        score["phantom falls"] += isinstance(ends[0], Dropped)
        if isinstance(ends[0], Released):
            off.append(float(np.linalg.norm(np.array(ends[0].spot.xy) - truth.ended_xy)))
    last = max((one.at for one in told if isinstance(one, Carried)), default=0.0)
    score["carried on after the end"] += last > truth.ended_at + 0.5


def main() -> int:
    parser = argparse.ArgumentParser(description="Right and wrong grasps of the hand agent in simulated fetches.")
    parser.add_argument("--runs", type=int, default=500, help="runs per case (default 500)")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    if arguments.runs < 1:
        parser.error("--runs must be positive")
    columns = ["case", "grasps", "right", "no tag", "wrong tag", "wrong at first", "missed", "phantom"]
    columns += ["tag after (median, 90 %)", "falls seen", "phantom falls", "put down off by (90 %)"]
    print(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    for number, case in enumerate(CASES):
        score: Counter[str] = Counter()
        late: list[float] = []
        off: list[float] = []
        for run in range(arguments.runs):
            if sys.stderr.isatty():
                sys.stderr.write(f"\r{case.name}: {run + 1} of {arguments.runs} ")
            fetch = Fetch(case, np.random.default_rng([arguments.seed, number, run]))
            told = fetch.play(Grasp())
            judge(fetch.truth, told, score, late, off)
        print(row(case, score, late, off))
    return 0


def row(case: Case, score: Counter[str], late: list[float], off: list[float]) -> str:
    grasps = score["grasps"]
    after = f"{np.median(late):.1f} s, {np.quantile(late, 0.9):.1f} s" if late else "-"
    falls = f"{score['falls seen']} of {score['falls']}" if score["falls"] else "-"
    cells = [case.name, grasps, f"{score['right'] / grasps:.1%}", score["no tag told"], score["wrong tag"],
             score["wrong for a while"], score["missed"], score["phantom"], after, falls, score["phantom falls"],
             f"{100 * np.quantile(off, 0.9):.0f} cm" if off else "-"]  # fmt: skip
    return f"| {' | '.join(map(str, cells))} |"


if __name__ == "__main__":
    sys.exit(main())
