"""A smart cabinet's shelf board: physics in, raw cell counts and tag rounds out, with the truth beside them.

Two ways to use it. For evaluation, ``run`` plays many seconds at once in the reader's own rhythm. Behind emulated
devices, ``step`` lets time pass, ``cell_counts`` is what the load cell board converted last, ``tags_in_zone`` plays one
round, and ``rf_on`` says whether an antenna is on. Positions are metres on the board, times seconds, weights grams.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.beat import moment
from tms_agents.simulation.board_hands import HandParameters, Hands, Trace, Xy, resting
from tms_agents.simulation.board_noise import CellBank, CellParameters
from tms_agents.simulation.board_plate import load_shares
from tms_agents.simulation.board_tags import InField, TagParameters, TagReader, TagRound
from tms_agents.simulation.world import Impossible

Floats = NDArray[np.float64]
#: Corner cells of the laboratory's cabinet.
LABORATORY_CELLS: tuple[Xy, ...] = ((0.04, 0.047), (0.425, 0.047), (0.04, 0.27), (0.425, 0.27))


@dataclass(frozen=True, kw_only=True, slots=True)
class BoardParameters:
    """Everything that makes one world easier or harder than another."""

    cells: tuple[Xy, ...] = LABORATORY_CELLS
    stiffness: tuple[float, ...] | None = None  # of the cells, equal by default
    torsion: float = math.inf  # stiffness of the board against twisting, relative to that of its cells
    width: float = 0.465
    depth: float = 0.317
    period_s: float = 0.02
    even: bool = True  # or on the uneven beat of our drivers, once per period
    electronics: CellParameters = field(default_factory=CellParameters)
    hands: HandParameters = field(default_factory=HandParameters)
    tags: TagParameters = field(default_factory=TagParameters)


@dataclass(frozen=True, kw_only=True, slots=True)
class Change:
    """The truth about one change: it began, and from ``stable`` on the load is what it stays.

    ``xy`` is where the thing stands afterwards, or stood before an "out". A "lean" changes nothing in the end.
    ``lifted``: a "move" through the air, and when the thing was off the board.
    """

    kind: Literal["in", "out", "move", "lean"]
    start: float
    stable: float
    xy: Xy
    name: str = ""
    tag: str | None = None
    weight_g: float = 0.0
    lifted: float | None = None


@dataclass(frozen=True, slots=True)
class Recording:
    """``counts`` (n, k) at ``t`` (n,), NaN where a cell said nothing; the rounds completed meanwhile."""

    t: Floats
    counts: Floats
    rounds: list[TagRound]


@dataclass(frozen=True, slots=True)
class Standing:
    """A thing on the board."""

    name: str
    weight_g: float
    xy: Xy
    tag: str | None
    trace: Trace = field(repr=False)


class BoardWorld:
    """One board, its cells, its reader and what people do there. Actions begin now and take their time."""

    def __init__(self, parameters: BoardParameters, rng: np.random.Generator) -> None:
        self.parameters = parameters
        self.shares = load_shares(parameters.cells, parameters.stiffness, parameters.torsion)
        cells, hands, reader = rng.spawn(3)
        self.electronics = CellBank(parameters.electronics, len(parameters.cells), parameters.period_s, cells)
        self.reader = TagReader(parameters.tags, reader)
        self.things: dict[str, Standing] = {}
        self.truth: deque[Change] = deque(maxlen=1000)
        self.rf_on = False
        self._hands = Hands(parameters.hands, hands)
        self._passing: list[Trace] = []  # forces that leave nothing behind
        self._field: list[InField] = []
        self._samples = 0
        self._owed_s = 0.0
        self._settled_at = 0.0

    @property
    def time_s(self) -> float:
        """Until when the cells have converted."""
        return self._samples * self.parameters.period_s

    @property
    def settled_at(self) -> float:
        """From when on all loads are what they stay, as far as is known now."""
        return max(self.time_s, self._settled_at)

    # time

    def run(self, seconds: float) -> Recording:
        """Play whole conversions for ``seconds``, antennas in their own rhythm."""
        t = self._next_times(round(seconds / self.parameters.period_s))
        before = self.time_s
        counts = self._convert(t, self.reader.on_at(t))
        rounds = [
            TagRound(end, zone, self.reader.read(zone, end, self._field))
            for end, zone in self.reader.rounds_between(before, self.time_s)
        ]
        self._forget()
        return Recording(t, counts, rounds)

    def step(self, seconds: float) -> None:
        """Let time pass for emulated devices; the cells convert in their own rhythm, the antenna is as ``rf_on``."""
        self._owed_s += seconds
        due = math.floor(self._owed_s / self.parameters.period_s + 1e-9)
        self._owed_s -= due * self.parameters.period_s
        if due > 0:
            t = self._next_times(due)
            self._convert(t, np.full(due, self.rf_on))
            self._forget()

    def cell_counts(self) -> Floats:
        """What the cells said last (k,), NaN for nothing."""
        return self.electronics.last.copy()

    def tags_in_zone(self, zone: str) -> frozenset[str]:
        """One round now."""
        return self.reader.read(zone, self.time_s, self._field)

    def grams(self, counts: Floats) -> Floats:
        """Counts (..., k) as grams, by an installer's calibration of the empty board."""
        return self.electronics.grams(counts)

    # what people do

    def stand(self, name: str, weight_g: float, xy: Xy, tag: str | None = None) -> None:
        """Something that stands there already when the story begins; no change."""
        self._require_new(name)
        self.things[name] = Standing(name, weight_g, xy, tag, resting(self.time_s, weight_g, xy))
        self._enter_field(tag, self.time_s, xy)

    def place(
        self, name: str, weight_g: float, xy: Xy, tag: str | None = None, *, slow: bool | None = None, after: float = 0
    ) -> Change:
        """Somebody puts a thing down, ``after`` seconds from now. Raises Impossible where it stands already."""
        self._require_new(name)
        seen_at = self.time_s + after
        start = seen_at + self._hands.approach()
        trace = self._hands.put(start, weight_g, xy, self._hands.seconds(slow))
        self.things[name] = Standing(name, weight_g, xy, tag, trace)
        self._enter_field(tag, seen_at, xy)
        return self._noted(_change("in", self.things[name], start, trace.end))

    def take(self, name: str, *, slow: bool | None = None, after: float = 0) -> Change:
        """Somebody takes a thing out. Raises Impossible where there is none, or it is still being put."""
        thing = self._at_rest(name, self.time_s + after)
        start = self.time_s + after
        trace = self._hands.take(start, thing.weight_g, thing.xy, self._hands.seconds(slow))
        del self.things[name]
        self._passing.append(trace)
        self._leave_field(thing.tag, trace.end + self._hands.approach())
        return self._noted(_change("out", thing, start, trace.end))

    def move(self, name: str, xy: Xy, *, slide: bool = False, slow: bool | None = None, after: float = 0) -> Change:
        """Somebody moves a thing on the board: through the air, or with ``slide`` along it."""
        thing, start = self._at_rest(name, self.time_s + after), self.time_s + after
        lifted = None
        if slide:
            trace = self._hands.slide(start, thing.weight_g, thing.xy, xy, slow)
        else:
            trace, lifted = self._hands.lift_and_put(start, thing.weight_g, thing.xy, xy, slow)
        self.things[name] = moved = replace(thing, xy=xy, trace=trace)
        middle = (start + trace.end) / 2
        self._leave_field(thing.tag, middle)
        self._enter_field(thing.tag, middle, xy)
        return self._noted(_change("move", moved, start, trace.end, lifted))

    def lean(self, xy: Xy, force_g: float | None = None, seconds: float | None = None) -> Change:
        """Somebody leans on the board."""
        trace = self._hands.lean(self.time_s, xy, force_g, seconds)
        self._passing.append(trace)
        return self._noted(Change(kind="lean", start=self.time_s, stable=trace.end, xy=xy))

    # inside

    def loads(self, t: Floats) -> Floats:
        """True load (n, k) of each cell at times (n,) from now on."""
        moments = np.zeros((len(t), 4))
        for trace in [*(thing.trace for thing in self.things.values()), *self._passing]:
            moments += trace.moments(t)
        loads: Floats = moments @ self.shares.T
        return loads

    def _next_times(self, samples: int) -> Floats:
        numbers, period_s = range(self._samples, self._samples + samples), self.parameters.period_s
        if self.parameters.even:
            return np.array([(number + 1) * period_s for number in numbers])
        return np.array([moment(number, period_s) for number in numbers])

    def _convert(self, t: Floats, rf_on: NDArray[np.bool_]) -> Floats:
        counts = self.electronics.read(t, self.loads(t), rf_on)
        self._samples += len(t)
        return counts

    def _forget(self) -> None:
        now = self.time_s
        self._passing = [trace for trace in self._passing if trace.end > now]
        self._field = [one for one in self._field if one.end > now]

    def _enter_field(self, tag: str | None, start: float, xy: Xy) -> None:
        if tag is not None:
            self._field.append(InField(tag, start, math.inf, xy))

    def _leave_field(self, tag: str | None, end: float) -> None:
        self._field = [replace(one, end=min(one.end, end)) if one.tag == tag else one for one in self._field]

    def _noted(self, change: Change) -> Change:
        self.truth.append(change)
        self._settled_at = max(self._settled_at, change.stable)
        return change

    def _require_new(self, name: str) -> None:
        if name in self.things:
            raise Impossible(f"{name} stands on the board already")

    def _at_rest(self, name: str, when: float) -> Standing:
        thing = self.things.get(name)
        if thing is None:
            raise Impossible(f"{name} does not stand on the board")
        if thing.trace.end > when:
            raise Impossible(f"{name} is still in somebody's hands")
        return thing


def _change(
    kind: Literal["in", "out", "move"], thing: Standing, start: float, stable: float, lifted: float | None = None
) -> Change:
    return Change(
        kind=kind,
        start=start,
        stable=stable,
        xy=thing.xy,
        name=thing.name,
        tag=thing.tag,
        weight_g=thing.weight_g,
        lifted=lifted,
    )
