"""Places that were visited again: where a later part of the path fits into an earlier submap, and how surely."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from tms_agents.slam.agreement import agreement
from tms_agents.slam.branch_and_bound import best_poses
from tms_agents.slam.geometry import Bytes, Floats, Ints, between, compose, inverse, wrapped
from tms_agents.slam.keyframes import Indices
from tms_agents.slam.maps import Maps, padded
from tms_agents.slam.matching import SHARE, match
from tms_agents.slam.sharing import queue, take
from tms_agents.slam.submaps import GROUP, Submaps, pyramids

#: Points of a cloud, keys on either side that it is made of, its least mean score in a search.
_POINTS, _AROUND, _LEAST = 300, 3, 0.5
_TURN_STEP = 0.025
#: Two places so far apart (m) where a cloud fits are two answers.
_APART_M = 0.5
#: The error of a beam (m); pyramids of so many submaps are in memory together.
_SIGMA_M, _SEARCHED = 0.1, 4
#: Closures within so much way (m, both ends added) should agree; a crowd is so much larger than its rivals to win,
#: and one counts by this power of how well it fits.
_CROWD_M, _CLEARLY, _MERIT = 60.0, 1.5, 16
#: A match holds if so large a share of the points ends near surfaces, among those that end where the submap knows
#: something, and so many points do;
#: near is within so many m.
_FITS, _KNOWN, _NEAR_M = 0.85, 0.4, 0.2
#: The precision of a cloud's match is that of so few independent witnesses; and it is never better than this (m, rad).
_WITNESSES, _FLOOR = 20.0, (0.04, 0.04, 0.006)


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """Key scan ``key`` seen from key scan ``anchor``, with ``information`` (3, 3)."""

    anchor: int
    key: int
    seen: Floats
    information: Floats
    fit: float


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """Did key scan ``key`` come back to submap ``number``? It is ``thought`` (3,) to be there, seen from its anchor,
    wrong by up to ``window`` m and ``turn`` rad. The whole window is searched where nothing near by fits, or
    ``anyway``: a filter that locked onto a corridor one door off fits near by, too."""

    number: int
    key: int
    thought: Floats
    window: float
    turn: float
    anyway: bool = False


def find_closures(submaps: Submaps, questions: Sequence[Question]) -> list[list[Closure]]:
    """Compare key scans with submaps, side by side: near by first, then in the whole window. None, one or two answers
    to each question."""
    found: list[list[Closure]] = [[] for _ in questions]
    groups: dict[int, list[int]] = {}
    for n, question in enumerate(questions):
        groups.setdefault(question.number // GROUP, []).append(n)
    for group in sorted(groups):
        asked = [questions[n] for n in groups[group]]
        for n, closures in zip(groups[group], _answers(submaps, group, asked), strict=True):
            found[n] = closures
    return found


def _answers(submaps: Submaps, group: int, questions: list[Question]) -> list[list[Closure]]:
    """Of questions about submaps of one group."""
    maps = submaps.rendered(group)
    clouds, lengths = padded([submaps.cloud(q.key, _AROUND, _POINTS) for q in questions])
    which: Ints = np.array([q.number - GROUP * group for q in questions], dtype=np.int32)
    thought = np.array([q.thought for q in questions])
    poses, hessians, fits = np.empty_like(thought), np.empty((len(which), 3, 3)), np.zeros(len(which))
    _refine(maps, which, clouds, lengths, thought, poses, hessians, fits)
    found: list[list[Closure]] = [[] for _ in questions]

    def keep(numbers: Indices, poses: Floats, hessians: Floats, fits: Floats) -> None:
        information = _information(hessians)
        for k, n in enumerate(numbers):
            cloud = clouds[n, : lengths[n]]
            match = poses[k], hessians[k], information[k]
            found[n] += _closure(submaps, maps, questions[n], cloud, *match, fits[k])

    near = np.flatnonzero(fits > 0.0)
    keep(near, poses[near], hessians[near], fits[near])
    widely = np.flatnonzero([q.window > 0 and (q.anyway or not found[n]) for n, q in enumerate(questions)])
    for some in _few_submaps(which, widely):
        starts, scores = np.empty((len(some), 3)), np.empty(len(some))
        searched, place = np.unique(which[some], return_inverse=True)
        levels, origin, scale = pyramids(maps, searched, _SIGMA_M)
        best_poses(
            levels, place.astype(np.int32), origin, scale, clouds[some], lengths[some], thought[some],
            np.array([questions[n].window for n in some]), np.array([questions[n].turn for n in some]),
            _TURN_STEP, _LEAST, starts, scores,
        )  # fmt: skip
        hit = some[scores > 0.0]
        again = np.empty((len(hit), 3)), np.empty((len(hit), 3, 3)), np.zeros(len(hit))
        _refine(maps, which[hit], clouds[hit], lengths[hit], starts[scores > 0.0], *again)
        new = np.hypot(*(again[0] - poses[hit])[:, :2].T) > _APART_M
        new |= np.array([not found[n] for n in hit], dtype=bool)
        new &= again[2] > 0.0
        keep(hit[new], *(part[new] for part in again))
    return found


def _few_submaps(which: Ints, asked: Indices) -> Iterator[Indices]:
    """``asked`` questions in parts that are about few submaps each: their pyramids are large."""
    numbers = np.unique(which[asked])
    for first in range(0, len(numbers), _SEARCHED):
        yield asked[np.isin(which[asked], numbers[first : first + _SEARCHED])]


def _closure(
    submaps: Submaps,
    maps: Maps,
    question: Question,
    cloud: Floats,
    pose: Floats,
    hessian: Floats,
    information: Floats,
    fit: float,
) -> list[Closure]:
    """What geometry found, or geometry and light together; none if light contradicts."""
    if submaps.light is not None:
        which = question.number % GROUP
        placed = submaps.light.placed(
            question.number, question.key, _AROUND, maps, which, cloud, pose, hessian, question.window
        )
        if placed is None or not _agrees(maps, which, cloud, placed[0]):
            return []
        pose, information = placed[0], _information(placed[1])
    return [Closure(int(submaps.anchors[question.number]), question.key, pose, information, float(fit))]


def _information(hessians: Floats) -> Floats:
    """(..., 3, 3) of matches with these ``hessians``, whose points are no independent witnesses."""
    found: Floats = np.linalg.inv(np.linalg.inv(hessians) * _WITNESSES + np.diag(np.square(_FLOOR)))
    return found


def _agrees(maps: Maps, which: int, cloud: Floats, pose: Floats) -> bool:
    near, free = agreement(
        maps.occupancy.directory[which], maps.occupancy.cells, maps.distance.directory[which], maps.distance.cells,
        maps.metres, maps.frame, cloud, pose, _NEAR_M,
    )  # fmt: skip
    return near >= _FITS * (near + free) and near + free >= _KNOWN * len(cloud)


def _refine(
    maps: Maps,
    which: Ints,
    clouds: Floats,
    lengths: Ints,
    starts: Floats,
    poses: Floats,
    hessians: Floats,
    fits: Floats,
) -> None:
    distance, occupancy = maps.distance, maps.occupancy
    _refine_all(
        distance.directory, distance.cells, maps.metres, maps.frame, occupancy.directory, occupancy.cells,
        which, clouds, lengths, starts, poses, hessians, fits,
    )  # fmt: skip


@njit(cache=True, parallel=True)
def _refine_all(
    directory: Ints,
    squared: Bytes,
    metres: Floats,
    frame: Floats,
    occupancy_directory: Ints,
    occupancy: Bytes,
    which: Ints,
    clouds: Floats,
    lengths: Ints,
    starts: Floats,
    poses: Floats,
    hessians: Floats,
    fits: Floats,
) -> None:
    """Matches of clouds (A, M, 2) in maps ``which`` (A,) from ``starts`` (A, 3): ``poses``, ``hessians``, and as
    ``fits`` (A,) the share that fits, 0 where the match does not hold."""
    loose = np.diag(np.array([1.0, 1.0, 25.0]))
    line = queue(len(which))
    for begin in prange(len(which)):
        a = take(line, begin)
        while a < len(which):
            one, cloud, result = which[a], clouds[a, : lengths[a]], np.empty(3)
            match(
                directory[one], squared, metres, frame, cloud, starts[a], starts[a], loose, _SIGMA_M, 1.0, poses[a],
                hessians[a], result,
            )  # fmt: skip
            near, free = 0, 0
            if result[SHARE] >= _KNOWN * _FITS:
                near, free = agreement(
                    occupancy_directory[one], occupancy, directory[one], squared, metres, frame, cloud, poses[a],
                    _NEAR_M,
                )  # fmt: skip
            holds = near > 0 and near >= _FITS * (near + free) and near + free >= _KNOWN * len(cloud)
            fits[a] = near / (near + free) if holds else 0.0
            a = take(line, a)


def consistent(closures: list[Closure], path: Floats, way: Floats) -> NDArray[np.bool_]:
    """(C,) which closures are borne out by others near by: going round between two of them leads back to the start.

    ``way`` (K,) m is the length of ``path`` (K, 3) until each key. Corridors with doors at equal distances fit into
    themselves in many ways, each of which has its own crowd of closures that agree: a closure needs two others, and the
    crowd of none that contradicts it may be nearly as large.
    """
    count = len(closures)
    if not count:
        return np.zeros(0, dtype=bool)
    anchors, keys = np.array([c.anchor for c in closures]), np.array([c.key for c in closures])
    seen = np.array([c.seen for c in closures])
    merit = np.array([c.fit for c in closures]) ** _MERIT
    apart = np.abs(way[keys] - way[keys][:, None]) + np.abs(way[anchors] - way[anchors][:, None])
    np.fill_diagonal(apart, np.inf)
    one, others = np.nonzero(apart < _CROWD_M)
    from_anchor = inverse(between(path[anchors[one]], path[anchors[others]]))
    expected = compose(compose(from_anchor, seen[one]), between(path[keys[one]], path[keys[others]]))
    error, far = expected - seen[others], apart[one, others]
    same = (np.hypot(error[:, 0], error[:, 1]) < 0.25 + 0.03 * far) & (
        np.abs(wrapped(error[:, 2])) < 0.05 + 0.003 * far
    )
    agree, contradict = np.zeros((count, count), dtype=bool), np.zeros((count, count), dtype=bool)
    agree[one[same], others[same]] = True
    contradict[one[~same], others[~same]] = True
    support = agree @ merit + merit
    rival = np.where(contradict | contradict.T, support, 0.0).max(axis=1)
    kept: NDArray[np.bool_] = (agree.sum(axis=1) >= 2) & (support > _CLEARLY * rival)
    return kept
