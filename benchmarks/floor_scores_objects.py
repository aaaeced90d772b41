"""Objects on the floor: was every thing found where it lay, kept while it was hidden, and let go when it was gone?

A span is one stay of a thing on the floor. A label belongs to a span if it was told during it, three times at least,
and its median place is within 12 cm and half the thing's size.

A thing has to be found if it can be told from a foot. All that a laser knows of a foot is where it stands and for how
long: 0.5 to 0.8 s in a stride, some 1.2 s when somebody stops, turns or makes a small step. What no two beams have
ever met at once, or any beam for less than two seconds altogether (furniture was pushed before it at once, or somebody
stood before it until he took it), looks like one more step. Such spans count neither as found nor as missed, and a
label there is not false. How long a thing was met is what really was, whatever the estimator makes of it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

Floats = NDArray[np.float64]
Truth = Mapping[str, Any]
Prediction = Sequence[Mapping[str, Any]]

#: Of what a false object was made: moved furniture, somebody's feet, a thing already gone or not there yet, no idea.
KINDS = ("furniture", "mover", "other")
_NEAR_M, _SETTLE_S, _STALE_S, _NO = 0.12, 2.0, 3.0, 1e3
#: What was in sight for less (s) looks like a foot.
_FOOT_S = 2.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Span:
    """What became of one stay. Seconds and metres, NaN or 0 where it does not apply.

    ``met_s``: for how long any beam met it; ``clear_s``: for how long two did at once.
    ``latency_s`` from when it could be seen; ``kept_s`` of ``hidden_s`` the label was there although nothing met the
    thing for a second or more, ``known_s`` of them since it was told first; ``removal_s`` from when its place was
    clear, NaN where it stayed or that is unknown.
    """

    thing: str
    size: float
    found: bool
    met_s: float = math.inf
    clear_s: float = math.inf
    latency_s: float = math.nan
    error_m: float = math.nan
    breaks: int = 0
    coverage: float = math.nan
    kept_s: float = 0.0
    hidden_s: float = 0.0
    known_s: float = 0.0
    removal_s: float = math.nan

    @property
    def needed(self) -> bool:
        """Whether it was in sight for long enough to be told from a foot."""
        return self.met_s >= _FOOT_S


@dataclass(frozen=True, slots=True)
class FalseObject:
    """A label of an object that was none."""

    kind: str
    since: float
    seconds: float
    xy: tuple[float, float]


@dataclass(frozen=True, slots=True)
class ObjectScores:
    """``seconds`` and furniture ``moves`` to divide by. Scores of several worlds add up."""

    spans: list[Span] = field(default_factory=list)
    false: list[FalseObject] = field(default_factory=list)
    seconds: float = 0.0
    moves: int = 0

    def __add__(self, other: ObjectScores) -> ObjectScores:
        return ObjectScores(
            self.spans + other.spans,
            self.false + other.false,
            self.seconds + other.seconds,
            self.moves + other.moves,
        )

    def recall(self, smallest: float = 0.0, largest: float = math.inf, clear_s: float = 0.0) -> float:
        """Share of the spans to be found (`needed`) that were found; NaN of none."""
        these = [span.found for span in self.needed(smallest, largest, clear_s)]
        return float(np.mean(these)) if these else math.nan

    def needed(self, smallest: float = 0.0, largest: float = math.inf, clear_s: float = 0.0) -> list[Span]:
        """The spans of things of these sizes, in sight of two beams for so long, that could be found."""
        these = [span for span in self.spans if span.needed and span.clear_s >= clear_s]
        return [span for span in these if smallest <= span.size <= largest]

    @property
    def glimpsed(self) -> list[Span]:
        """Spans of things that were hardly ever in sight."""
        return [span for span in self.spans if not span.needed]

    @property
    def precision(self) -> float:
        found = sum(span.found for span in self.spans)
        return found / max(found + len(self.false), 1)

    @property
    def kept(self) -> float:
        """Share of the time hidden."""
        hidden = sum(span.hidden_s for span in self.spans)
        return sum(span.kept_s for span in self.spans) / hidden if hidden > 0 else math.nan

    @property
    def held(self) -> float:
        """Share of the time hidden since it was told first."""
        known = sum(span.known_s for span in self.spans)
        return sum(span.kept_s for span in self.spans) / known if known > 0 else math.nan

    @property
    def breaks(self) -> int:
        return sum(span.breaks for span in self.spans)

    def per_ten_minutes(self, *kinds: str) -> float:
        """False objects, of these kinds or of all."""
        count = sum(one.kind in (kinds or KINDS) for one in self.false)
        return 600 * count / self.seconds if self.seconds else math.nan

    def per_move(self) -> float:
        """False objects of moved furniture per move."""
        return sum(one.kind == "furniture" for one in self.false) / self.moves if self.moves else math.nan

    def values(self, name: str) -> Floats:
        """``latency_s``, ``error_m``, ``coverage`` or ``removal_s`` of all spans that have it."""
        found = np.array([getattr(span, name) for span in self.spans if span.found], dtype=float)
        return np.asarray(found[np.isfinite(found)])

    def median(self, name: str) -> float:
        values = self.values(name)
        return float(np.median(values)) if len(values) else math.nan

    @property
    def stale(self) -> int:
        """Labels that outlived their thing by more than three seconds."""
        return int((self.values("removal_s") > _STALE_S).sum())

    def summary(self) -> str:
        kinds = Counter(one.kind for one in self.false)
        return (
            f"objects: recall {self.recall():.3f} of {len(self.needed())}, precision {self.precision:.3f}, "
            f"latency {self.median('latency_s'):.2f} s, error {1e3 * self.median('error_m'):.0f} mm, "
            f"breaks {self.breaks}, kept {self.kept:.3f}, removal {self.median('removal_s'):.2f} s, "
            f"stale {self.stale}, false {dict(kinds)}"
        )


def score_objects(truth: Truth, prediction: Prediction) -> ObjectScores:
    """The objects alone."""
    told_at = np.array([frame["t"] for frame in prediction])
    tracks = _tracks(prediction)
    spans = [
        (thing, span) for thing in truth["objects"] for span in thing["spans"] if span["first_visible"] is not None
    ]
    end = truth["duration"]
    gaps = np.full((len(spans), len(tracks)), _NO)
    labels = list(tracks)
    rate = len(told_at) / (told_at[-1] - told_at[0]) if len(told_at) > 1 else 1.0
    for i, (thing, span) in enumerate(spans):
        until = end if not span["t_picked"] else span["first_clear"] or end
        for j, label in enumerate(labels):
            t, x, y = tracks[label].T
            during = (t >= span["t_placed"] - 0.1) & (t <= until)
            if during.sum() < 3:
                continue
            gap = float(np.median(np.hypot(x[during] - span["x"], y[during] - span["y"])))
            if gap <= _NEAR_M + thing["size"] / 2:
                gaps[i, j] = gap - 1e-3 * min(during.sum() / rate, 50)  # of two as near, the one told for longer
    rows, columns = linear_sum_assignment(gaps)
    best = {int(i): int(j) for i, j in zip(rows, columns, strict=True) if gaps[i, j] < _NO / 2}
    results = []
    for i, (thing, span) in enumerate(spans):
        if i in best:
            mine = [tracks[labels[j]] for j in range(len(labels)) if gaps[i, j] < _NO / 2]
            results.append(_followed(thing, span, tracks[labels[best[i]]], mine, told_at, end))
        else:
            one, two = _met_s(span, end), _clear_s(span, end)
            results.append(Span(thing=thing["id"], size=thing["size"], found=False, met_s=one, clear_s=two))
    nobodys = [tracks[label] for j, label in enumerate(labels) if not (gaps[:, j] < _NO / 2).any()]
    step = (told_at[-1] - told_at[0]) / max(len(told_at) - 1, 1)
    false = [
        FalseObject(
            _kind(track, truth),
            float(track[0, 0]),
            len(track) * float(step),
            (float(np.median(track[:, 1])), float(np.median(track[:, 2]))),
        )
        for track in nobodys
    ]
    moves = sum(event["type"] == "furniture" for event in truth["events"])
    return ObjectScores(results, false, float(truth["duration"]), moves)


def _tracks(prediction: Prediction) -> dict[Any, Floats]:
    """Label -> (n, 3): t, x, y of every time it was told as an object."""
    found: dict[Any, list[tuple[float, float, float]]] = {}
    for frame in prediction:
        for one in frame["labels"]:
            if one["attr"] == "object":
                found.setdefault(one["id"], []).append((frame["t"], one["x"], one["y"]))
    return {label: np.array(track) for label, track in found.items()}


def _followed(
    thing: Mapping[str, Any],
    span: Mapping[str, Any],
    best: Floats,
    mine: Sequence[Floats],
    told_at: Floats,
    end: float,
) -> Span:
    """One span with the label that fits best, and with all that belong to it."""
    until = span["t_picked"] or end
    first = span["first_visible"]
    during = best[(best[:, 0] >= span["t_placed"]) & (best[:, 0] <= until)]
    errors = np.hypot(during[:, 1] - span["x"], during[:, 2] - span["y"])
    wanted = told_at[(told_at >= first + _SETTLE_S) & (told_at < until)]
    told = np.isin(np.round(wanted, 6), np.round(np.concatenate([track[:, 0] for track in mine]), 6))
    hidden = np.zeros(len(wanted), dtype=bool)
    for begin, stop in span["occluded"]:
        if begin >= first + _SETTLE_S:
            hidden |= (wanted >= begin) & (wanted <= stop)
    step = (told_at[-1] - told_at[0]) / max(len(told_at) - 1, 1)
    gone = max(track[-1, 0] for track in mine)
    return Span(
        thing=thing["id"],
        size=thing["size"],
        found=True,
        met_s=_met_s(span, end),
        clear_s=_clear_s(span, end),
        latency_s=max(0.0, float(min(track[0, 0] for track in mine)) - first),
        error_m=float(np.median(errors)) if len(errors) else math.nan,
        breaks=len(mine) - 1,
        coverage=float(told.mean()) if len(wanted) else math.nan,
        kept_s=float((told & hidden).sum() * step),
        hidden_s=float(hidden.sum() * step),
        known_s=float((hidden & (wanted >= min(track[0, 0] for track in mine))).sum() * step),
        removal_s=float(gone - span["first_clear"]) if span["t_picked"] and span["first_clear"] else math.nan,
    )


def _met_s(span: Mapping[str, Any], end: float) -> float:
    """For how long a beam met it; older recordings tell only for which share of the time two did."""
    return float(span["met_s"]) if "met_s" in span else _clear_s(span, end)


def _clear_s(span: Mapping[str, Any], end: float) -> float:
    """For how long two beams met it at once."""
    during = (span["t_picked"] or end) - span["t_placed"]
    return float(span.get("visible_fraction", 1.0) * during)


def _kind(track: Floats, truth: Truth) -> str:
    """Where a false object came from."""
    x, y = np.median(track[:, 1]), np.median(track[:, 2])
    for piece in truth["furniture"]:
        reach = 0.45 + max(piece["w"], piece["h"]) / 2
        for before, after in zip(piece["poses"][:-1], piece["poses"][1:], strict=True):
            near = any(np.hypot(x - p["pose"][0], y - p["pose"][1]) < reach for p in (before, after))
            if near and track[-1, 0] >= after["t"] - 3.5:
                return "furniture"
    samples = track[:: max(1, len(track) // 50)]
    times = np.array(truth["t"])
    with_somebody = sum(_somebody_near(truth, times, t, px, py) for t, px, py in samples)
    return "mover" if with_somebody > 0.5 * len(samples) else "other"


def _somebody_near(truth: Truth, times: Floats, t: float, x: float, y: float) -> bool:
    k = min(int(np.searchsorted(times, t)), len(times) - 1)
    for mover in truth["movers"]:
        i = k - mover["frames"][0]
        if 0 <= i < len(mover["x"]) and np.hypot(mover["x"][i] - x, mover["y"][i] - y) < 0.35:
            return True
    return False
