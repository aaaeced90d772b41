"""A household that uses a shelf board: random changes, one at a time or two at once, and arms that lean on it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from tms_agents.simulation.board import BoardWorld, Change, Recording
from tms_agents.simulation.board_hands import Xy


@dataclass(frozen=True, kw_only=True, slots=True)
class LifeParameters:
    """What is in the household and how it is used. Ranges are drawn from uniformly, weights log-uniformly."""

    things: int = 14
    tagged_share: float = 0.8
    weight_g: tuple[float, float] = (25.0, 2000.0)
    most_on_board: int = 6
    #: Rest between a change's end and the next one.
    rest_s: tuple[float, float] = (6.0, 12.0)
    #: Of the changes: two things at once (beginning within ``stagger_s``), moves, leaning; the rest comes and goes.
    pair_share: float = 0.15
    stagger_s: float = 1.5
    move_share: float = 0.25
    lean_share: float = 0.05
    #: Of the moves: along the board, and how far.
    slide_share: float = 0.3
    slide_m: tuple[float, float] = (0.05, 0.15)
    #: Of the episodes: a cell repeats itself from before the change until after it; the board is off for some seconds
    #: of the rest.
    stuck_share: float = 0.0
    power_share: float = 0.0
    off_s: tuple[float, float] = (1.0, 4.0)
    #: Things keep so far from the board's edge and, where there is room, from one another.
    margin_m: float = 0.03
    apart_m: float = 0.08


@dataclass(frozen=True, slots=True)
class Episode:
    """What happened between two rests, and what the board said until the next begins."""

    changes: tuple[Change, ...]
    recording: Recording


class Household:
    def __init__(self, world: BoardWorld, parameters: LifeParameters, rng: np.random.Generator) -> None:
        self.world, self.parameters, self._rng = world, parameters, rng
        low, high = np.log(parameters.weight_g)
        self.weights = {f"thing{i}": float(np.exp(rng.uniform(low, high))) for i in range(parameters.things)}
        self.tags = {
            name: f"E00401{i:010X}" for i, name in enumerate(self.weights) if rng.random() < parameters.tagged_share
        }

    def live(self, changes: int) -> Iterator[Episode]:
        """Episodes until at least so many things have come, gone or moved."""
        yield Episode((), self.world.run(5.0))
        done = 0
        while done < changes:
            stuck = self._stick()
            made = self._act()
            done += sum(change.kind != "lean" for change in made)
            seconds = self.world.settled_at - self.world.time_s + self._rng.uniform(*self.parameters.rest_s)
            recording = self.world.run(seconds)
            if stuck is not None:
                self.world.electronics.repair(stuck)
            elif self._rng.random() < self.parameters.power_share:
                recording = _joined(recording, self._power_cycle())
            yield Episode(made, recording)

    def _stick(self) -> int | None:
        if self._rng.random() >= self.parameters.stuck_share:
            return None
        cell = int(self._rng.integers(len(self.world.parameters.cells)))
        self.world.electronics.stick(cell)
        return cell

    def _power_cycle(self) -> Recording:
        self.world.electronics.power(False)
        dark = self.world.run(float(self._rng.uniform(*self.parameters.off_s)))
        self.world.electronics.power(True)
        return _joined(dark, self.world.run(float(self._rng.uniform(*self.parameters.rest_s))))

    def _act(self) -> tuple[Change, ...]:
        p, rng = self.parameters, self._rng
        kind = rng.random()
        if kind < p.lean_share:
            return (self.world.lean((rng.uniform(0, self.world.parameters.width), p.margin_m)),)
        if kind < p.lean_share + p.pair_share:
            first = self._come_or_go(0.0)
            return (first, self._come_or_go(float(rng.uniform(0, p.stagger_s)), but=first.name))
        if kind < p.lean_share + p.pair_share + p.move_share and self.world.things:
            name = self._pick(self.world.things)
            if rng.random() < p.slide_share:
                return (self.world.move(name, self._beside(self.world.things[name].xy), slide=True),)
            return (self.world.move(name, self._spot()),)
        return (self._come_or_go(0.0),)

    def _come_or_go(self, after: float, but: str = "") -> Change:
        there = [name for name in self.world.things if name != but]
        absent = [name for name in self.weights if name not in self.world.things and name != but]
        fill = len(self.world.things) / self.parameters.most_on_board
        if there and (not absent or self._rng.random() < fill):
            return self.world.take(self._pick(there), after=after)
        name = self._pick(absent)
        return self.world.place(name, self.weights[name], self._spot(), self.tags.get(name), after=after)

    def _pick(self, names: Iterable[str]) -> str:
        choice = sorted(names)
        return str(choice[int(self._rng.integers(len(choice)))])

    def _beside(self, xy: Xy) -> Xy:
        """A place on the board to which a thing may be pushed from ``xy``."""
        p, board = self.parameters, self.world.parameters
        while True:
            way, angle = self._rng.uniform(*p.slide_m), self._rng.uniform(0, 2 * math.pi)
            x, y = xy[0] + way * math.cos(angle), xy[1] + way * math.sin(angle)
            if p.margin_m <= x <= board.width - p.margin_m and p.margin_m <= y <= board.depth - p.margin_m:
                return (x, y)

    def _spot(self) -> Xy:
        """A free place, or after many tries any place."""
        p, board = self.parameters, self.world.parameters
        taken = [thing.xy for thing in self.world.things.values()]
        for _ in range(30):
            x = float(self._rng.uniform(p.margin_m, board.width - p.margin_m))
            y = float(self._rng.uniform(p.margin_m, board.depth - p.margin_m))
            if all(math.dist((x, y), other) >= p.apart_m for other in taken):
                break
        return (x, y)


def _joined(a: Recording, b: Recording) -> Recording:
    return Recording(np.concatenate([a.t, b.t]), np.concatenate([a.counts, b.counts]), [*a.rounds, *b.rounds])
