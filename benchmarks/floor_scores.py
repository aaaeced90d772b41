"""How well labels of the floor agree with what was: CLEAR, IDF1, HOTA and GOSPA of movers; life and death of objects.

    scores = score(truth, prediction)      # as `data/floor/sim/*.json`; as `tms floor replay` writes

Definitions: CLEAR (Bernardin and Stiefelhagen 2008), IDF1 (Ristani 2016), HOTA (Luiten 2020; similarity 1 - distance
in metres), GOSPA (Rahmathullah 2017; p 2, c 0.5 m, alpha 2), on a grid of 10 Hz with a gate of 0.5 m. A mover that no
beam met for more than a second may be reported but need not be; labels outside the region count for nothing.
"""

from __future__ import annotations

import json
import math
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from floor_scores_objects import ObjectScores, score_objects
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

Floats = NDArray[np.float64]
Truth = Mapping[str, Any]
Prediction = Sequence[Mapping[str, Any]]

GATE_M, GRID_HZ, UNSEEN_S, START_S = 0.5, 10.0, 1.0, 2.0
_GOSPA_C = 0.5
_NO = 1e3


@dataclass(frozen=True, kw_only=True, slots=True)
class MoverScores:
    """``needed`` true positions were to be found; ``people`` true stays, ``labels`` ids given."""

    mota: float
    motp: float
    idf1: float
    hota: float
    gospa: float
    switches: int
    false: int
    missed: int
    needed: int
    people: int
    labels: int


@dataclass(frozen=True, slots=True)
class Scores:
    movers: MoverScores
    objects: ObjectScores


@dataclass(frozen=True, slots=True, eq=False)
class _Instant:
    """True movers (n) and labels (m) at one time of the grid: who must be found, which labels count."""

    names: list[str]
    places: Floats  # (n, 2)
    seen: list[bool]
    labels: list[Any]
    told: Floats  # (m, 2)
    inside: list[bool]

    def distances(self) -> Floats:
        return np.asarray(np.linalg.norm(self.places[:, None] - self.told[None], axis=2))


def score(truth: Truth, prediction: Prediction) -> Scores:
    """Scores of a prediction. Raises ValueError where there is nothing to score."""
    if not prediction:
        raise ValueError("the prediction has no frames")
    return Scores(score_movers(truth, prediction), score_objects(truth, prediction))


def score_movers(truth: Truth, prediction: Prediction) -> MoverScores:
    """The movers alone."""
    instants = list(instants_of(truth, prediction))
    before: dict[str, Any] = {}
    together: Counter[tuple[str, Any]] = Counter()
    found = missed = false = switches = 0
    gaps: list[float] = []
    gospa: list[float] = []
    kept: list[_Instant] = []
    for now in instants:
        apart = now.distances()
        pairs = _matched(now, apart, before)
        for i, j in pairs:
            name, label = now.names[i], now.labels[j]
            switches += name in before and before[name] != label
            before[name] = label
            together[name, label] += 1
            gaps.append(float(apart[i, j]))
        matched = {i for i, _ in pairs}, {j for _, j in pairs}
        needed = [i for i in range(len(now.names)) if i in matched[0] or now.seen[i]]
        counted = [j for j in range(len(now.labels)) if j in matched[1] or now.inside[j]]
        found += len(pairs)
        missed += len(needed) - len(pairs)
        false += len(counted) - len(pairs)
        kept.append(_part(now, needed, counted))
        gospa.append(_gospa(apart[np.ix_(needed, counted)]))
    needed_all = found + missed
    return MoverScores(
        mota=1 - (missed + false + switches) / max(needed_all, 1),
        motp=float(np.mean(gaps)) if gaps else math.nan,
        idf1=2 * _identified(together) / max(needed_all + found + false, 1),
        hota=_hota(kept),
        gospa=float(np.mean(gospa)) if gospa else math.nan,
        switches=switches,
        false=false,
        missed=missed,
        needed=needed_all,
        people=len(truth["movers"]),
        labels=len({one["id"] for frame in prediction for one in frame["labels"] if one["attr"] == "mover"}),
    )


def instants_of(truth: Truth, prediction: Prediction) -> Sequence[_Instant]:
    """Truth and labels side by side at each time of the grid; labels are those of the last scan before it."""
    t = np.array(truth["t"])
    told_at = np.array([frame["t"] for frame in prediction])
    grid = np.arange(START_S, truth["duration"] - 0.05, 1 / GRID_HZ)
    frames = np.searchsorted(t, grid).clip(0, len(t) - 1)
    told = np.searchsorted(told_at, grid + 1e-6) - 1
    unseen = {mover["id"]: _unseen_for(mover, t) for mover in truth["movers"]}
    region = np.array(truth["region"]) if truth.get("region") else None
    found = []
    for k, q in zip(frames, told, strict=True):
        here = [mover for mover in truth["movers"] if mover["frames"][0] <= k < mover["frames"][1]]
        places = [(m["x"][k - m["frames"][0]], m["y"][k - m["frames"][0]]) for m in here]
        labels = [one for one in (prediction[q]["labels"] if q >= 0 else ()) if one["attr"] == "mover"]
        xy = np.array([(one["x"], one["y"]) for one in labels]).reshape(-1, 2)
        found.append(
            _Instant(
                [mover["id"] for mover in here],
                np.array(places).reshape(-1, 2),
                [bool(unseen[mover["id"]][k] <= UNSEEN_S) for mover in here],
                [one["id"] for one in labels],
                xy,
                [region is None or inside(region, x, y) for x, y in xy],
            )
        )
    return found


def inside(polygon: Floats, x: float, y: float) -> bool:
    """Whether a ray to the right crosses the border an odd number of times."""
    ax, ay = polygon[:, 0], polygon[:, 1]
    bx, by = np.roll(ax, -1), np.roll(ay, -1)
    crosses = (ay > y) != (by > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = ax + (y - ay) * (bx - ax) / (by - ay)
    return bool(np.count_nonzero(crosses & (x < at)) % 2)


def _unseen_for(mover: Mapping[str, Any], t: Floats) -> Floats:
    """Seconds at each frame since a beam of any laser last met this mover."""
    hits = np.zeros(len(t))
    for one in mover["hits"].values():
        counts = np.array(one, dtype=float)
        if len(counts) != len(t):  # of another laser, with scans of its own
            counts = np.interp(np.arange(len(t)), np.linspace(0, len(t) - 1, len(counts)), counts)
        hits = np.maximum(hits, counts)
    return np.asarray(t - np.maximum.accumulate(np.where(hits > 0, t, -9.0)))


def _matched(now: _Instant, apart: Floats, before: Mapping[str, Any]) -> list[tuple[int, int]]:
    """Pairs within the gate: those of the last time as long as they are, the rest so that they are near."""
    cost = np.where(apart <= GATE_M, apart, _NO)
    for i, name in enumerate(now.names):
        for j, label in enumerate(now.labels):
            if apart[i, j] <= GATE_M and name in before and before[name] == label:
                cost[i, j] = -1
    rows, columns = linear_sum_assignment(cost)
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if cost[i, j] < _NO]


def _part(now: _Instant, movers: list[int], labels: list[int]) -> _Instant:
    return _Instant(
        [now.names[i] for i in movers],
        now.places[movers],
        [now.seen[i] for i in movers],
        [now.labels[j] for j in labels],
        now.told[labels],
        [now.inside[j] for j in labels],
    )


def _gospa(apart: Floats) -> float:
    limit = _GOSPA_C**2
    cost = np.minimum(apart**2, limit)
    rows, columns = linear_sum_assignment(cost)
    near = [cost[i, j] for i, j in zip(rows, columns, strict=True) if cost[i, j] < limit]
    return math.sqrt(sum(near) + limit / 2 * (sum(apart.shape) - 2 * len(near)))


def _identified(together: Mapping[tuple[str, Any], int]) -> int:
    """Instants at which a mover carried the label that is his in the best one-to-one naming."""
    names = sorted({name for name, _ in together})
    labels = sorted({label for _, label in together}, key=str)
    table = np.array([[together.get((name, label), 0) for label in labels] for name in names])
    if table.size == 0:
        return 0
    rows, columns = linear_sum_assignment(table, maximize=True)
    return int(table[rows, columns].sum())


def _hota(instants: Sequence[_Instant]) -> float:
    """Mean over 19 thresholds of the geometric mean of detection and association."""
    names = {name: i for i, name in enumerate(dict.fromkeys(name for now in instants for name in now.names))}
    labels = {label: j for j, label in enumerate(dict.fromkeys(label for now in instants for label in now.labels))}
    if not names:
        return math.nan
    shape = (len(names), len(labels))
    lived, told, alike = np.zeros(shape[0]), np.zeros(shape[1]), np.zeros(shape)
    steps = []
    for now in instants:
        rows = np.array([names[name] for name in now.names], dtype=int)
        columns = np.array([labels[label] for label in now.labels], dtype=int)
        lived[rows] += 1
        told[columns] += 1
        likeness = np.clip(1 - now.distances(), 0, 1)
        if likeness.size:
            union = likeness.sum(axis=0)[None] + likeness.sum(axis=1)[:, None] - likeness
            alike[np.ix_(rows, columns)] += likeness / np.maximum(union, 1e-12)
            steps.append((rows, columns, likeness))
    belong = alike / np.maximum(lived[:, None] + told[None] - alike, 1e-12)
    values = []
    for threshold in np.arange(0.05, 0.96, 0.05):
        hits, count = 0, np.zeros(shape)
        for rows, columns, likeness in steps:
            enough = likeness >= threshold - 1e-9
            wish = np.where(enough, belong[np.ix_(rows, columns)] + 1e-6 * likeness + 1e-9, 0)
            i, j = linear_sum_assignment(wish, maximize=True)
            good = enough[i, j]
            hits += int(good.sum())
            count[rows[i[good]], columns[j[good]]] += 1
        detection = hits / (lived.sum() + told.sum() - hits)
        association = (count**2 / np.maximum(lived[:, None] + told[None] - count, 1)).sum() / max(hits, 1)
        values.append(math.sqrt(detection * association))
    return float(np.mean(values))


def load(path: Path) -> Any:
    """A JSON file of truth or prediction."""
    return json.loads(path.read_text())


def main(arguments: Sequence[str]) -> None:
    """python benchmarks/floor_scores.py TRUTH.json PREDICTION.json"""
    scores = score(load(Path(arguments[0])), load(Path(arguments[1])))
    print(scores.movers)
    print(scores.objects.summary())


if __name__ == "__main__":
    main(sys.argv[1:])
