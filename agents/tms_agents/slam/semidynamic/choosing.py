"""Which candidates together: every object has its own place, most things are where they were, hinges do not move."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats, transform, wrapped
from tms_agents.slam.semidynamic.shapes import Shape
from tms_agents.slam.semidynamic.visits import Visit

#: How much better another pose must be than the one before: within a pass of the robot, and after it was parked.
_SAME_PASS, _SAME_PLACE = 5.0, 1.0
#: Points of an outline so near to another object's outline (m) are one surface, and count so much less.
_SHARED_M, _SHARED = 0.05, 0.5
#: Poses nearer to each other (m, rad) are the same.
SAME_M, SAME_RAD = 0.08, 0.2
#: At most so many times all anew; scores so near are the same.
_STARTS, _SWEEPS, _SAME_SCORE = 6, 4, 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Family:
    """Candidates that can follow each other: per visit poses (C, 3) and their scores (C,)."""

    poses: tuple[Floats, ...]
    scores: tuple[Floats, ...]


@dataclass(slots=True, eq=False)
class Track:
    """All visits of one tag; ``chosen`` poses (V, 3) once there are any, ``total`` their score."""

    tag: str
    shape: Shape
    visits: Sequence[Visit]
    families: Sequence[Family]
    chosen: Floats | None = None
    total: float = 0.0
    #: By the array of poses, the other tag and its pose: what they share.
    overlaps: dict[tuple[int, str, bytes], Floats] = field(default_factory=dict)
    #: By family and visit: which poses are those of the visit before.
    same: dict[tuple[int, int], NDArray[np.bool_]] = field(default_factory=dict)

    def outline(self, pose: Floats) -> Floats:
        return transform(pose, self.shape.outline)


def choose(tracks: Mapping[str, Track], random: np.random.Generator) -> None:
    """Sets ``chosen`` of every track. Begun from several orders, the best by themselves first at the first time: things
    that look alike may stand in each other's places, which takes more than one step to put right."""
    at_once = _at_once(tracks)
    tags = sorted(tracks, key=lambda tag: (-_best_alone(tracks[tag]), tag))
    best, found = -np.inf, {}
    for _ in range(_STARTS):
        for track in tracks.values():
            track.chosen = None
        for tag in tags:
            _solve(tracks[tag], tracks, at_once)
        _improve(tracks, at_once)
        total = _total(tracks, at_once)
        if total > best + _SAME_SCORE:
            best, found = total, {tag: track.chosen for tag, track in tracks.items()}
        tags = [tags[n] for n in random.permutation(len(tags))]
    for tag, track in tracks.items():
        track.chosen = found[tag]


def complete(tracks: Mapping[str, Track]) -> None:
    """Sets ``chosen`` of those tracks that have none yet, given the others."""
    at_once = _at_once(tracks)
    missing = [tag for tag, track in sorted(tracks.items()) if track.chosen is None]
    for tag in missing * 2:
        _solve(tracks[tag], tracks, at_once)


def _improve(tracks: Mapping[str, Track], at_once: _Shared) -> None:
    """One by one, then pairs in both orders, while that is better."""
    for _ in range(_SWEEPS):
        changed = False
        for tag in sorted(tracks):
            before = tracks[tag].total
            _solve(tracks[tag], tracks, at_once)
            changed |= abs(tracks[tag].total - before) > _SAME_SCORE
        for a, b in itertools.combinations(sorted(tracks), 2):
            if any(other == b for visit in at_once[a] for other, _ in visit):
                changed |= _again(tracks[a], tracks[b], tracks, at_once)
        if not changed:
            break


def _total(tracks: Mapping[str, Track], at_once: _Shared) -> float:
    """Of all as chosen; what several share counts once."""
    total, left = 0.0, set(tracks)
    for tag in sorted(tracks):
        left.discard(tag)
        total += _viterbi(tracks[tag], tracks, at_once, fixed=tracks[tag].chosen, without=frozenset(left))[1]
    return total


_Shared = Mapping[str, Sequence[Sequence[tuple[str, int]]]]


def _at_once(tracks: Mapping[str, Track]) -> _Shared:
    """Per tag and visit: other tags and their visits that share scans."""
    found: dict[str, list[list[tuple[str, int]]]] = {tag: [[] for _ in one.visits] for tag, one in tracks.items()}
    for a, b in itertools.permutations(tracks, 2):
        for i, visit in enumerate(tracks[a].visits):
            for j, other in enumerate(tracks[b].visits):
                if len(np.intersect1d(visit.scans, other.scans)):
                    found[a][i].append((b, j))
    return found


def _best_alone(track: Track) -> float:
    return max(sum(float(scores.max()) for scores in family.scores) for family in track.families)


def _again(a: Track, b: Track, tracks: Mapping[str, Track], at_once: _Shared) -> bool:
    """Both anew, one after the other in both orders; whether that was better."""
    kept = (a.chosen, b.chosen)
    best, found = _joint(a, b, tracks, at_once), kept
    for first, second in ((a, b), (b, a)):
        a.chosen = b.chosen = None
        _solve(first, tracks, at_once)
        _solve(second, tracks, at_once)
        _solve(first, tracks, at_once)
        total = _joint(a, b, tracks, at_once)
        if total > best + _SAME_SCORE:
            best, found = total, (a.chosen, b.chosen)
    a.chosen, b.chosen = found
    return found is not kept


def _joint(a: Track, b: Track, tracks: Mapping[str, Track], at_once: _Shared) -> float:
    """Of two tracks as chosen; what they share counts once."""
    _, alone = _viterbi(a, tracks, at_once, fixed=a.chosen, without=frozenset({b.tag}))
    _, other = _viterbi(b, tracks, at_once, fixed=b.chosen)
    return alone + other


def _solve(track: Track, tracks: Mapping[str, Track], at_once: _Shared) -> None:
    track.chosen, track.total = _viterbi(track, tracks, at_once)


def _viterbi(
    track: Track,
    tracks: Mapping[str, Track],
    at_once: _Shared,
    *,
    fixed: Floats | None = None,
    without: frozenset[str] = frozenset(),
) -> tuple[Floats, float]:
    best, found = -np.inf, np.empty((0, 3))
    for which, family in enumerate(track.families):
        rows: list[NDArray[np.bool_]] = []
        if fixed is not None:
            rows = [(poses == pose).all(axis=1) for poses, pose in zip(family.poses, fixed, strict=True)]
            if not all(row.any() for row in rows):
                continue
        costs = []
        for number, (poses, scores) in enumerate(zip(family.poses, family.scores, strict=True)):
            score = scores - _shared(track, number, poses, tracks, at_once, without)
            if rows:
                score = np.where(rows[number], score, -np.inf)
            costs.append(score)
        total, back = costs[0], []
        for number in range(1, len(costs)):
            step = total[:, None] + _stays(track, number, which)
            back.append(np.argmax(step, axis=0))
            total = step.max(axis=0) + costs[number]
        last = int(np.argmax(total))
        if total[last] > best:
            best = float(total[last])
            picked = [last]
            for pointers in reversed(back):
                picked.append(int(pointers[picked[-1]]))
            found = np.array([family.poses[n][i] for n, i in enumerate(reversed(picked))])
    return found, best


def _stays(track: Track, number: int, which: int) -> Floats:
    """(C, D) what it is worth that the pose before visit ``number`` is the pose in it."""
    if (which, number) not in track.same:
        before, after = (track.families[which].poses[n] for n in (number - 1, number))
        apart = after[None, :, :] - before[:, None, :]
        near = np.hypot(apart[..., 0], apart[..., 1]) < SAME_M
        track.same[which, number] = near & (np.abs(wrapped(apart[..., 2])) < SAME_RAD)
    bonus = _SAME_PASS if track.visits[number].leg == track.visits[number - 1].leg else _SAME_PLACE
    found: Floats = np.where(track.same[which, number], bonus, 0.0)
    return found


def _shared(
    track: Track, number: int, poses: Floats, tracks: Mapping[str, Track], at_once: _Shared, without: frozenset[str]
) -> Floats:
    """(C,) what other objects at the same time already explain."""
    total: Floats = np.zeros(len(poses))
    for tag, theirs in at_once[track.tag][number]:
        chosen = tracks[tag].chosen
        if chosen is not None and tag not in without:
            total += _overlap(track, poses, tracks[tag], chosen[theirs])
    return total


def _overlap(track: Track, poses: Floats, other: Track, pose: Floats) -> Floats:
    """(C,) what an object at ``poses`` shares with the ``other`` one at ``pose``."""
    key = (id(poses), other.tag, pose.tobytes())
    if key not in track.overlaps:
        near = np.hypot(*(poses[:, :2] - pose[:2]).T) < track.shape.size + other.shape.size
        found = np.zeros(len(poses))
        if near.any():
            found[near] = _SHARED * _near_points(poses[near], track.shape.outline, other.outline(pose), _SHARED_M)
        track.overlaps[key] = found
    return track.overlaps[key]


@njit(cache=True)
def _near_points(poses: Floats, outline: Floats, other: Floats, reach: float) -> Floats:
    """(C,) how many points of ``outline`` (M, 2), seen from ``poses`` (C, 3), are within ``reach`` m of ``other``
    points (N, 2)."""
    found = np.zeros(len(poses))
    for n in range(len(poses)):
        c, s = np.cos(poses[n, 2]), np.sin(poses[n, 2])
        for m in range(len(outline)):
            x = poses[n, 0] + c * outline[m, 0] - s * outline[m, 1]
            y = poses[n, 1] + s * outline[m, 0] + c * outline[m, 1]
            for k in range(len(other)):
                if (other[k, 0] - x) ** 2 + (other[k, 1] - y) ** 2 < reach * reach:
                    found[n] += 1.0
                    break
    return found
