"""Loop closing behind the filter: find revisits, believe those that bear each other out, bend the path, look again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tms_agents.slam.closures import Closure, Question, consistent, find_closures
from tms_agents.slam.geometry import Floats, between, wrapped
from tms_agents.slam.keyframes import KeyScans
from tms_agents.slam.light.scans import LightScan
from tms_agents.slam.maps import padded
from tms_agents.slam.matching import curvatures
from tms_agents.slam.posegraph import Edges, Indices, optimise
from tms_agents.slam.recent import recent_path
from tms_agents.slam.settings import Settings
from tms_agents.slam.submaps import GROUP, Submaps

#: A place counts as visited again after so much way; submaps are asked whose anchor may be so near (m).
_GAP_M, _NEAR_M = 25.0, 8.0
#: A query every so many m of way; at most so many submaps each.
_QUERY_M, _ASKED = 4.0, 5
#: A revisit may be off by so many standard deviations of the path between, whose variance is taken this much larger;
#: jumps of the filter (m, rad) come on top. No search is wider than the last two (m, rad).
_DEVIATIONS, _INFLATED, _JUMP, _WIDEST = 3.0, 2.0, (0.7, 0.7, 0.05), (12.0, 0.4)
#: Loops with a larger chi2 lose weight, and are dropped at the end above the second.
_SWITCH, _DROP = 10.0, 30.0
#: The precision of a scan's match is that of so few independent witnesses; never better than this (m, rad).
_WITNESSES, _FLOOR = 8.0, (0.004, 0.004, 0.0015)
_ROUNDS = 3
#: A step of the path is torn where it is so many standard deviations of odometry off.
_TORN = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Closed:
    """``path`` (K, 3) after loop closing; revisits that were believed and such that were not; how far poses moved
    (m)."""

    path: Floats
    believed: int
    rejected: int
    moved: float


def close_loops(path: Floats, keys: KeyScans, settings: Settings, lights: Sequence[LightScan] | None = None) -> Closed:
    """``path`` (K, 3) of the robot at the key scans, or the same way again by the newest scans alone, bent until
    revisits fit, by their ``lights``, too."""
    again = recent_path(path, keys, settings, lights)
    closed, other = (_closed(one, keys, settings, lights) for one in (path, again))
    # Which of the two is truer from step to step is seen best by how many revisits fit in then, and by odometry.
    if _merit(other, again, keys, settings) <= _merit(closed, path, keys, settings):
        return closed
    return replace(other, moved=float(np.hypot(*(other.path - path)[:, :2].T).max()))


def _merit(closed: Closed, path: Floats, keys: KeyScans, settings: Settings) -> int:
    """What bears ``path`` (K, 3) out less what contradicts it: revisits, and steps that odometry cannot be so wrong
    of."""
    motions = between(keys.odometry[:-1], keys.odometry[1:])
    off = between(path[:-1], path[1:]) - motions
    off[:, 2] = wrapped(off[:, 2])
    noise = settings.noise.covariance(motions, np.diff(keys.driven, axis=0))
    squares = np.einsum("ki,kij,kj->k", off, np.linalg.inv(noise), off)
    return closed.believed - closed.rejected - int(np.count_nonzero(squares > _TORN**2))


def _closed(path: Floats, keys: KeyScans, settings: Settings, lights: Sequence[LightScan] | None) -> Closed:
    """Round by round, from one path."""
    way = keys.driven[:, 0] - keys.driven[0, 0]
    submaps = Submaps(path, keys, settings, lights)
    chain = _chain(submaps, keys, settings)
    drift = Drift(path, chain)
    found, believed, rejected = path, 0, 0
    for turn in range(_ROUNDS):
        closures = _revisits(submaps, found, way, drift, widely=turn == 0)
        kept = consistent(closures, path, way)
        loops = _edges([c for c, keep in zip(closures, kept, strict=True) if keep])
        # Where loops tear far, all pull with full weight at first; who is alone against the others lets go then.
        start = optimise(found, chain, loops) if turn == 0 else found
        bent = optimise(start, chain, loops, _SWITCH)
        good = loops.chi2(bent) < _DROP
        loops = loops.chosen(good)
        bent = optimise(bent, chain, loops, _SWITCH)
        believed, rejected = len(loops), len(closures) - len(loops)
        moved = float(np.hypot(*(bent - found)[:, :2].T).max())
        found = bent
        if turn > 0 and moved < 0.1:
            break
    return Closed(found, believed, rejected, float(np.hypot(*(found - path)[:, :2].T).max()))


def _revisits(submaps: Submaps, path: Floats, way: Floats, drift: Drift, *, widely: bool) -> list[Closure]:
    """Closures of query keys with submaps that were perhaps near, by ``path`` and its drift, and long before."""
    questions, covariances = [], []
    anchors = submaps.anchors
    for key in np.flatnonzero(np.diff((way / _QUERY_M).astype(int), prepend=-1)):
        before = np.flatnonzero((way[key] - way[anchors] > _GAP_M) & (anchors < key))
        spreads = drift.between(anchors[before], np.full(len(before), key))
        window, turn = np.full(len(before), 1.0), np.full(len(before), 0.1)
        if widely:
            spread = np.sqrt(np.linalg.eigvalsh(spreads[:, :2, :2])[:, -1])
            window = np.minimum(_WIDEST[0], _DEVIATIONS * spread)
            turn = np.minimum(_WIDEST[1], _DEVIATIONS * np.sqrt(spreads[:, 2, 2]))
        apart = np.hypot(*(path[anchors[before], :2] - path[key, :2]).T)
        for one in np.argsort(apart - 0.5 * window, kind="stable")[:_ASKED]:
            if apart[one] > _NEAR_M + window[one]:
                continue
            thought = between(path[anchors[before[one]]], path[key])
            questions.append(
                Question(int(before[one]), int(key), thought, float(window[one]), float(turn[one]), widely)
            )
            covariances.append(spreads[one])
    found = find_closures(submaps, questions)
    return [
        closure
        for closures, covariance in zip(found, covariances, strict=True)
        for closure in closures
        if drift.plausible(closure, covariance)
    ]


class Drift:
    """How wrong the way between two keys may be: covariances of the chain, carried to one point, add up."""

    def __init__(self, path: Floats, chain: Edges) -> None:
        self._path = path
        carried = _carried(path[1:])
        frame = _rotations(path[:-1, 2])
        covariance = frame @ np.linalg.inv(chain.information) @ frame.swapaxes(1, 2)
        parts = carried @ covariance @ carried.swapaxes(1, 2)
        self._sums = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(parts, axis=0)])
        self._back = np.linalg.inv(_carried(path))

    def between(self, first: Indices, second: Indices) -> Floats:
        """(E, 3, 3) of keys ``second`` seen from keys ``first``, in the frames of those."""
        whole = self._sums[second] - self._sums[first]
        back = self._back[second]
        turned = _rotations(-self._path[first, 2])
        there = turned @ back @ whole @ back.swapaxes(1, 2) @ turned.swapaxes(1, 2)
        found: Floats = _INFLATED * there + np.diag(np.square(_JUMP))
        return found

    def plausible(self, closure: Closure, covariance: Floats) -> bool:
        """Whether the path of the filter can be so wrong."""
        error = closure.seen - between(self._path[closure.anchor], self._path[closure.key])
        error[2] = wrapped(error[2])
        return float(error @ np.linalg.solve(covariance, error)) < _DEVIATIONS**2


def _carried(poses: Floats) -> Floats:
    """(N, 3, 3) that turn an error at ``poses`` (N, 3), world frame, into one at the origin: a turn moves what is
    far."""
    found = np.tile(np.eye(3), (len(poses), 1, 1))
    found[:, 0, 2], found[:, 1, 2] = poses[:, 1], -poses[:, 0]
    return found


def _edges(closures: list[Closure]) -> Edges:
    return Edges(
        np.array([c.anchor for c in closures], dtype=np.int64),
        np.array([c.key for c in closures], dtype=np.int64),
        np.array([c.seen for c in closures]).reshape(-1, 3),
        np.array([c.information for c in closures]).reshape(-1, 3, 3),
    )


def _chain(submaps: Submaps, keys: KeyScans, settings: Settings) -> Edges:
    """From key to key as the filter found it, as sure as each scan is in its submap together with odometry."""
    path = submaps.path
    seen = between(path[:-1], path[1:])
    motions = between(keys.odometry[:-1], keys.odometry[1:])
    noise = settings.noise.covariance(motions, np.diff(keys.driven, axis=0))
    numbers = np.arange(1, len(path))
    number = submaps.of(numbers)
    anchors = submaps.anchors[number]
    turned = _rotations(path[numbers - 1, 2] - path[anchors, 2])
    back = turned.swapaxes(1, 2)
    hessians = np.empty((len(seen), 3, 3))
    for group in np.unique(number // GROUP):
        mine = np.flatnonzero(number // GROUP == group)
        maps = submaps.rendered(int(group))
        points, lengths = padded([keys.scans[int(k)] for k in numbers[mine]])
        found = np.empty((len(mine), 3, 3))
        curvatures(
            maps.distance.directory, maps.distance.cells, maps.metres, maps.frame,
            (number[mine] - GROUP * group).astype(np.int32), points, lengths,
            between(path[anchors[mine]], path[numbers[mine]]),
            _WITNESSES * (turned[mine] @ np.linalg.inv(noise[mine]) @ back[mine]), settings.sigma_m, found,
        )  # fmt: skip
        hessians[mine] = found
        if submaps.light is not None:
            for k in mine:
                submaps.light.add(int(number[k]), int(numbers[k]), hessians[k])
    covariance = _WITNESSES * (back @ np.linalg.inv(hessians) @ turned) + np.diag(np.square(_FLOOR))
    return Edges(np.arange(len(seen)), numbers, seen, np.linalg.inv(covariance))


def _rotations(angles: Floats) -> Floats:
    """(N, 3, 3)."""
    found = np.tile(np.eye(3), (len(angles), 1, 1))
    cosine, sine = np.cos(angles), np.sin(angles)
    found[:, 0, 0], found[:, 0, 1], found[:, 1, 0], found[:, 1, 1] = cosine, -sine, sine, cosine
    return found
