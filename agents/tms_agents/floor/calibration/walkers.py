"""Where a laser stands, found from people that another laser sees at the same time. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.scans import Array
from tms_agents.floor import FloorEstimator, FloorSettings, Sensor
from tms_agents.floor.recordings.recorded import Recorded
from tms_agents.floor.scan.walls import wrapped
from tms_agents.floor.settings import Pose

#: Tracks are compared at this pace; those that are shorter tell nothing.
_STEP_S, _SHORTEST_S = 0.1, 1.5
#: Two lasers see other sides of a leg: the same person is this near in both.
_SAME_M = 0.25
_MOST_OFFSET_S = 0.5
#: A pose so far from another one (m, rad) is another pose.
_OTHER_M, _OTHER = 0.5, 0.26
#: Errors of where a walker is are the same for so many steps, and of so much (m) all the way: of a leg two lasers see
#: two sides.
_ALIKE, _SIDES_M = 10, 0.05


@dataclass(frozen=True, slots=True)
class Track:
    """Where one walker was: ``t`` (n,) s rising, ``xy`` (n, 2) m."""

    t: Array
    xy: Array


@dataclass(frozen=True, slots=True)
class Registration:
    """Pose of the laser, residual and number of the places that both saw, and how far its clock is behind (s).

    ``sd`` are the standard deviations of place and direction (m, rad); ``rival`` is how well the best pose elsewhere
    explains what was seen, 1 being as well as this one.
    """

    pose: Pose
    rmse_m: float
    places: int
    offset_s: float
    sd: tuple[float, float]
    rival: float


def walker_tracks(recorded: Recorded, pose: Pose, settings: FloorSettings | None = None) -> list[Track]:
    """The walkers that one laser saw, were it at ``pose``."""
    estimator = FloorEstimator({recorded.name: Sensor(recorded.sweep, pose, recorded.range_scale)}, settings)
    found: dict[int, list[tuple[float, float, float]]] = {}
    for n in range(len(recorded)):
        t = float(recorded.t[n])
        estimator.scan(recorded.name, t, recorded.scan(n).ranges)
        for one in estimator.labels():
            if one.kind == "mover" and not one.stale and t - one.seen_at < 0.05:
                found.setdefault(one.id, []).append((t, *one.xy))
    tracks = [np.array(places) for places in found.values()]
    return [Track(one[:, 0], one[:, 1:]) for one in tracks if one[-1, 0] - one[0, 0] >= _SHORTEST_S]


def register(known: Sequence[Track], local: Sequence[Track]) -> Registration:
    """``known`` tracks are in the room, ``local`` ones in the frame of the laser that is looked for.

    Of several people at once it finds out who is who.

    Raises:
        ValueError: nobody was seen by both for long enough, or nobody walked far enough to tell.
    """
    candidates: list[_Candidate] = []
    for offset in np.arange(-_MOST_OFFSET_S, _MOST_OFFSET_S + 1e-9, 0.05):
        pairs = [_together(one, other, float(offset)) for one in known for other in local]
        pairs = [pair for pair in pairs if len(pair[0]) >= _SHORTEST_S / _STEP_S]
        for there, here in pairs:
            if np.ptp(there, axis=0).max() < 0.5:
                continue
            move = _rigid(here, there)
            for _ in range(5):
                kept_there, kept_here = _same(pairs, move)
                if len(kept_here) < 3:
                    break
                move = _rigid(kept_here, kept_there)
            kept_there, kept_here = _same(pairs, move)
            if len(kept_here) < _SHORTEST_S / _STEP_S:
                continue
            rmse = float(np.sqrt(np.mean(np.sum((_moved(kept_here, move) - kept_there) ** 2, axis=1))))
            candidates.append(_Candidate(len(kept_here), rmse, float(offset), move))
    if not candidates:
        raise ValueError("nobody was seen walking by both lasers at the same time")
    best = max(candidates, key=lambda one: one.worth)
    rivals = [one.worth for one in candidates if one.elsewhere(best)]
    return _finished(known, local, best, max(rivals, default=0.0) / best.worth)


@dataclass(frozen=True, slots=True)
class _Candidate:
    places: int
    rmse: float
    offset: float
    move: NDArray[np.float64]

    @property
    def worth(self) -> float:
        """More places seen together are better, and nearer ones."""
        return self.places / (0.03 + self.rmse)

    def elsewhere(self, other: _Candidate) -> bool:
        turned = abs(wrapped(self.move[2] - other.move[2]))
        return math.dist(self.move[:2], other.move[:2]) > _OTHER_M or turned > _OTHER


def _finished(known: Sequence[Track], local: Sequence[Track], best: _Candidate, rival: float) -> Registration:
    pairs = [_together(one, other, best.offset) for one in known for other in local]
    there, _ = _same([pair for pair in pairs if len(pair[0])], best.move)
    spread = np.sqrt(np.linalg.eigvalsh(np.cov(there.T))) if len(there) > 2 else np.zeros(2)
    if spread[1] < 0.3:
        raise ValueError("nobody walked far enough before both lasers: half a metre says little of directions")
    pose = (float(best.move[0]), float(best.move[1]), wrapped(best.move[2]))
    middle = best.rmse / math.sqrt(len(there) / _ALIKE)
    turned = middle / float(np.hypot(*spread))
    away = turned * math.dist(there.mean(axis=0), pose[:2])
    return Registration(
        pose, best.rmse, best.places, best.offset, (math.hypot(middle, away, _SIDES_M), turned), min(1.0, rival)
    )


def _together(one: Track, other: Track, offset: float) -> tuple[Array, Array]:
    """Places of both at the same times, (n, 2) each."""
    start, end = max(one.t[0], other.t[0] + offset), min(one.t[-1], other.t[-1] + offset)
    if end - start < _SHORTEST_S:
        return np.empty((0, 2)), np.empty((0, 2))
    t = np.arange(start, end, _STEP_S)
    # Where one of both lost sight of the walker there is nothing to compare.
    seen = _seen(one.t, t) & _seen(other.t + offset, t)
    return _at(one.t, one.xy, t[seen]), _at(other.t + offset, other.xy, t[seen])


def _seen(times: Array, t: Array) -> NDArray[np.bool_]:
    after = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
    near: NDArray[np.bool_] = times[after] - times[after - 1] < 0.5
    return near


def _at(times: Array, xy: Array, t: Array) -> Array:
    return np.stack([np.interp(t, times, xy[:, 0]), np.interp(t, times, xy[:, 1])], axis=1)


def _rigid(here: Array, there: Array) -> NDArray[np.float64]:
    """x, y, theta that bring ``here`` best onto ``there`` (Umeyama, without scale)."""
    a, b = here - here.mean(axis=0), there - there.mean(axis=0)
    theta = np.arctan2(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a * b))
    x, y = there.mean(axis=0) - _moved(here.mean(axis=0)[None], np.array([0.0, 0.0, theta]))[0]
    return np.array([x, y, theta])


def _moved(points: Array, move: NDArray[np.float64]) -> Array:
    cos, sin = np.cos(move[2]), np.sin(move[2])
    moved: Array = points @ np.array([[cos, sin], [-sin, cos]]) + move[:2]
    return moved


def _same(pairs: Sequence[tuple[Array, Array]], move: NDArray[np.float64]) -> tuple[Array, Array]:
    """Of all pairs the places that are the same person's at this pose."""
    near = [np.hypot(*(_moved(here, move) - there).T) < _SAME_M for there, here in pairs]
    kept = [(there[ok], here[ok]) for (there, here), ok in zip(pairs, near, strict=True)]
    if not kept:
        return np.empty((0, 2)), np.empty((0, 2))
    return np.concatenate([one[0] for one in kept]), np.concatenate([one[1] for one in kept])
