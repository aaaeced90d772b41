"""Loop closing behind the filter: find revisits, believe those that bear each other out, bend the path, look again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tms_agents.slam.closures import Closure, consistent, find_closure
from tms_agents.slam.geometry import Floats, between, wrapped
from tms_agents.slam.light.scans import LightScan
from tms_agents.slam.matching import linearise
from tms_agents.slam.mending import mended
from tms_agents.slam.posegraph import Edges, Indices, optimise
from tms_agents.slam.settings import Settings
from tms_agents.slam.submaps import Submaps

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


@dataclass(frozen=True, slots=True, eq=False)
class Closed:
    """``path`` (K, 3) after loop closing; revisits that were believed and such that were not; how far poses moved
    (m)."""

    path: Floats
    believed: int
    rejected: int
    moved: float


def close_loops(
    path: Floats,
    odometry: Floats,
    driven: Floats,
    scans: Sequence[Floats],
    laser: Floats,
    settings: Settings,
    lights: Sequence[LightScan] | None = None,
) -> Closed:
    """``path``, ``odometry`` (K, 3), ``driven`` (K, 2), ``scans`` and perhaps ``lights`` of the key scans, ``laser``
    (2,)."""
    again = mended(path, odometry, driven, scans, laser, settings, lights)
    closed = _closed(path, odometry, driven, scans, laser, settings, lights)
    if np.allclose(again, path, atol=1e-6):
        return closed
    # Whether a jump of the filter was right is seen best by how many revisits fit in then.
    other = _closed(again, odometry, driven, scans, laser, settings, lights)
    if other.believed - other.rejected <= closed.believed - closed.rejected:
        return closed
    return replace(other, moved=float(np.hypot(*(other.path - path)[:, :2].T).max()))


def _closed(
    path: Floats,
    odometry: Floats,
    driven: Floats,
    scans: Sequence[Floats],
    laser: Floats,
    settings: Settings,
    lights: Sequence[LightScan] | None,
) -> Closed:
    """Round by round, from one path."""
    way = driven[:, 0] - driven[0, 0]
    laser = np.ascontiguousarray(laser)
    submaps = Submaps(path, driven, scans, laser, settings, lights)
    chain = _chain(submaps, odometry, driven, scans, settings)
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
    found = []
    queries = np.flatnonzero(np.diff((way / _QUERY_M).astype(int), prepend=-1))
    anchors = submaps.anchors
    for key in queries:
        before = np.flatnonzero((way[key] - way[anchors] > _GAP_M) & (anchors < key))
        covariances = drift.between(anchors[before], np.full(len(before), key))
        window, turn = np.full(len(before), 1.0), np.full(len(before), 0.1)
        if widely:
            spread = np.sqrt(np.linalg.eigvalsh(covariances[:, :2, :2])[:, -1])
            window = np.minimum(_WIDEST[0], _DEVIATIONS * spread)
            turn = np.minimum(_WIDEST[1], _DEVIATIONS * np.sqrt(covariances[:, 2, 2]))
        apart = np.hypot(*(path[anchors[before], :2] - path[key, :2]).T)
        for one in np.argsort(apart - 0.5 * window, kind="stable")[:_ASKED]:
            if apart[one] > _NEAR_M + window[one]:
                continue
            number = int(before[one])
            thought = between(path[anchors[number]], path[key])
            closure = find_closure(submaps, number, int(key), thought, float(window[one]), float(turn[one]))
            if closure is not None and drift.plausible(closure, covariances[one]):
                found.append(closure)
    return found


class Drift:
    """How wrong the way between two keys may be: covariances of the chain, carried to one point, add up."""

    def __init__(self, path: Floats, chain: Edges) -> None:
        self._path = path
        carried = _carried(path[1:])
        frame = _rotations(path[:-1, 2])
        covariance = frame @ np.linalg.inv(chain.information) @ frame.swapaxes(1, 2)
        parts = carried @ covariance @ carried.swapaxes(1, 2)
        self._sums = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(parts, axis=0)])

    def between(self, first: Indices, second: Indices) -> Floats:
        """(E, 3, 3) of keys ``second`` seen from keys ``first``, in the frames of those."""
        whole = self._sums[second] - self._sums[first]
        back = np.linalg.inv(_carried(self._path[second]))
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


def _chain(submaps: Submaps, odometry: Floats, driven: Floats, scans: Sequence[Floats], settings: Settings) -> Edges:
    """From key to key as the filter found it, as sure as each scan is in its submap together with odometry."""
    path = submaps.path
    seen = between(path[:-1], path[1:])
    information = np.empty((len(seen), 3, 3))
    noise = settings.noise.covariance(between(odometry[:-1], odometry[1:]), np.diff(driven, axis=0))
    gradient, result = np.empty(3), np.empty(3)
    for k in range(1, len(path)):
        submap = submaps.rendered(submaps.of(k))
        pose = between(path[submap.anchor], path[k])
        turned = _rotations(path[k - 1 : k, 2] - path[submap.anchor, 2])[0]
        prior = turned @ np.linalg.inv(noise[k - 1]) @ turned.T
        hessian = np.empty((3, 3))
        maps = submap.maps
        linearise(
            maps.distance.directory[0], maps.distance.cells, maps.metres, maps.frame, scans[k], pose, pose,
            prior * _WITNESSES, settings.sigma_m, 1.0, hessian, gradient, result,
        )  # fmt: skip
        if submaps.light is not None:
            submaps.light.add(submaps.of(k), k, hessian)
        covariance = turned.T @ np.linalg.inv(hessian) @ turned * _WITNESSES + np.diag(np.square(_FLOOR))
        information[k - 1] = np.linalg.inv(covariance)
    keys = np.arange(len(path))
    return Edges(keys[:-1], keys[1:], seen, information)


def _rotations(angles: Floats) -> Floats:
    """(N, 3, 3)."""
    found = np.tile(np.eye(3), (len(angles), 1, 1))
    cosine, sine = np.cos(angles), np.sin(angles)
    found[:, 0, 0], found[:, 0, 1], found[:, 1, 0], found[:, 1, 1] = cosine, -sine, sine, cosine
    return found
