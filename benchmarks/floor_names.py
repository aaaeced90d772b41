"""How likely people who met are told to have been exchanged, against how often they were.

    python benchmarks/floor_names.py --scenes "three,three close,eight" --seeds 1090-1099     (make bench-names)

After each meeting of two people (nearer than a metre) the estimator says how likely their labels were exchanged. What
is true is looked up: whose each label was before, and whether the other one is his after. Log loss in nats of what is
told, of what would be told if nothing were (they never are, but for one in a thousand), and if it were as often for
all.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from floor_contestants import Ours
from numpy.typing import NDArray

from tms_agents.floor import Confused
from tms_agents.floor.movers.doubts import Doubts
from tms_agents.simulation.floor_world import LASERS, FloorWorld

Floats = NDArray[np.float64]

#: Of a label is whoever is nearest, if so near (m), most of the time from so long before they met to so long before
#: it (s), and so long before it is told.
_NEAR_M, _BEFORE_S, _JUST_S, _AFTER_S = 0.5, 3.0, 0.3, 2.0
_EDGES = (0.0, 1e-9, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)
_NEVER = 1e-3


class Job(NamedTuple):
    """A room to be played; ``laser`` is one of `LASERS`."""

    scene: str
    seed: int
    feet: Any
    laser: str


class Judged(NamedTuple):
    """Two labels that met: how likely it is told that they were exchanged, and how many of the two were: 0, 0.5, 1."""

    p: float
    exchanged: float


class Overheard(Doubts):
    """Keeps what it tells of each meeting: when, the labels, when they met, how likely they were exchanged."""

    def __init__(self, most: int) -> None:
        super().__init__(most)
        self.found: list[tuple[float, int, int, float, float]] = []

    def _judge(self, pair: tuple[int, int], t: float) -> list[Confused]:
        told = super()._judge(pair, t)
        self.found.append((t, *pair, self._doubts[pair].since, told[0].p if told else 0.0))
        return told


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default="three,three close,eight", help="comma separated")
    parser.add_argument("--seeds", default="1090-1099", help="FIRST-LAST")
    parser.add_argument("--lasers", default="fine", help="comma separated: fine, coarse, faint")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    args = parser.parse_args(arguments)
    first, last = (int(seed) for seed in args.seeds.split("-"))
    print("| laser | feet | scene | meetings | exchanged | told, in the mean | nats: told | nothing told | as often |")
    print("|---|---|---|---|---|---|---|---|---|")
    with ProcessPoolExecutor(args.jobs) as pool:
        for laser in args.lasers.split(","):
            for feet in ("legs", "prints"):
                every: list[Judged] = []
                for scene in args.scenes.split(","):
                    jobs = [Job(scene, seed, feet, laser) for seed in range(first, last + 1)]
                    found = [one for judged in pool.map(play, jobs) for one in judged]
                    every += found
                    print(f"| {laser} | {feet} | {scene} | {_row(found)} |", flush=True)
                print(_reliability(every), flush=True)


def play(job: Job) -> list[Judged]:
    """All meetings of one room of which the truth can be told."""
    world = FloorWorld(job.scene, job.seed, feet=job.feet, laser=LASERS[job.laser])
    sensors = {name: (mount.laser.sweep(), mount.reported) for name, mount in world.sensors.items()}
    made: list[Overheard] = []

    def overheard(most: int) -> Overheard:
        made.append(Overheard(most))
        return made[-1]

    with patch("tms_agents.floor.movers.tracks.Doubts", overheard):
        ours = Ours(sensors, world.known())
    labels = []
    for frame in world.scans():
        ours.scan(frame.sensor, frame.t, frame.ranges, frame.intensities if job.laser == "fine" else None)
        labels.append((frame.t, {one["id"]: (one["x"], one["y"]) for one in ours.labels() if one["attr"] == "mover"}))
    whose = _owners(world.truth(), labels)
    times = np.array([t for t, _ in labels])
    judged = []
    for t, a, b, since, p in made[0].found:
        before = times.searchsorted([since - _BEFORE_S, since - _JUST_S])
        after = times.searchsorted([max(since + _JUST_S, t - _AFTER_S), t])
        one, two = (_most(whose[slice(*span)], a) for span in (before, after))
        other, another = (_most(whose[slice(*span)], b) for span in (before, after))
        became = [after == before for before, after in ((one, another), (other, two)) if after is not None]
        if None not in (one, other) and one != other and became:
            judged.append(Judged(p, float(np.mean(became))))
    return judged


def _owners(truth: dict[str, Any], labels: Sequence[tuple[float, dict[int, tuple[float, float]]]]) -> list[Any]:
    """Of each scan: label -> who is there."""
    grid, found = np.array(truth["t"]), []
    for t, there in labels:
        k = min(int(grid.searchsorted(t)), len(grid) - 1)
        here = {
            mover["id"]: (mover["x"][k - mover["frames"][0]], mover["y"][k - mover["frames"][0]])
            for mover in truth["movers"]
            if mover["frames"][0] <= k < mover["frames"][1]
        }
        now = {}
        for label, xy in there.items():
            away = {who: float(np.hypot(xy[0] - at[0], xy[1] - at[1])) for who, at in here.items()}
            if away and min(away.values()) < _NEAR_M:
                now[label] = min(away, key=lambda who: away[who])
        found.append(now)
    return found


def _most(whose: Sequence[dict[int, str]], label: int) -> str | None:
    """Whose the label was most of the time."""
    names = Counter(one[label] for one in whose if label in one)
    return names.most_common(1)[0][0] if names else None


def _row(found: Sequence[Judged]) -> str:
    if not found:
        return "0 | | | | | "
    p, true = np.array([one.p for one in found]), np.array([one.exchanged for one in found])
    rate = np.full(len(p), true.mean())
    losses = " | ".join(f"{_loss(q, true):.3f}" for q in (p, np.zeros(len(p)), rate))
    return f"{len(p)} | {true.sum():g} ({true.mean():.3f}) | {p.mean():.3f} | {losses}"


def _loss(p: Floats, true: Floats) -> float:
    p = p.clip(_NEVER, 1.0 - _NEVER)
    return float(-np.mean(true * np.log(p) + (1.0 - true) * np.log(1.0 - p)))


def _reliability(found: Sequence[Judged]) -> str:
    """How often they were exchanged, by what was told."""
    p, true = np.array([one.p for one in found]), np.array([one.exchanged for one in found])
    lines = []
    for low, high in pairwise(_EDGES):
        if (here := (p >= low) & (p < high) if high < 1.0 else (p >= low)).any():
            lines.append(f"told {p[here].mean():.3f} of {here.sum()}: {true[here].mean():.3f} were exchanged")
    return "\n".join(["", *lines, ""])


if __name__ == "__main__":
    main()
