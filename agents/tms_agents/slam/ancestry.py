"""Paths of particles as a tree of ancestors: what particles have in common is stored once."""

from __future__ import annotations

import numpy as np
from numba import njit

from tms_agents.slam.geometry import Floats, Ints


class Ancestry:
    """A node per particle and step, pruned to the nodes that living particles come from."""

    def __init__(self, particles: int) -> None:
        self._parents: Ints = np.full(64 * particles, -1, dtype=np.int32)
        self._poses: Floats = np.empty((64 * particles, 3))
        self._used = 0
        self._leaves: Ints = np.full(particles, -1, dtype=np.int32)

    @property
    def nodes(self) -> int:
        """Poses that are stored, of dead particles, too, until they are in the way."""
        return self._used

    def append(self, poses: Floats) -> None:
        """One step of all particles (N, 3)."""
        if self._used + len(poses) > len(self._poses):
            self._prune(len(poses))
        new = slice(self._used, self._used + len(poses))
        self._parents[new] = self._leaves
        self._poses[new] = poses
        self._leaves = np.arange(new.start, new.stop, dtype=np.int32)
        self._used = new.stop

    def resample(self, parents: Ints) -> None:
        """Particle n goes on from where particle ``parents[n]`` was."""
        self._leaves = self._leaves[parents]

    def path(self, particle: int) -> Floats:
        """(steps, 3) poses of a particle and its ancestors, oldest first."""
        nodes = []
        node = int(self._leaves[particle])
        while node >= 0:
            nodes.append(node)
            node = int(self._parents[node])
        return self._poses[nodes[::-1]]

    def _prune(self, room: int) -> None:
        self._used = _compact(self._parents, self._poses, self._used, self._leaves)
        size = len(self._poses)
        if self._used + room > size // 2:
            self._parents = np.concatenate([self._parents, np.full(size, -1, dtype=np.int32)])
            self._poses = np.concatenate([self._poses, np.empty((size, 3))])


@njit(cache=True)
def _compact(parents: Ints, poses: Floats, used: int, leaves: Ints) -> int:
    """Move nodes that a leaf comes from to the front (a parent is always before its children); their number."""
    place = np.full(used, -1, dtype=np.int32)
    for leaf in leaves:
        node = leaf
        while node >= 0 and place[node] < 0:
            place[node] = 0
            node = parents[node]
    kept = 0
    for node in range(used):
        if place[node] == 0:
            place[node] = kept
            parents[kept] = place[parents[node]] if parents[node] >= 0 else -1
            poses[kept] = poses[node]
            kept += 1
    for n in range(len(leaves)):
        if leaves[n] >= 0:
            leaves[n] = place[leaves[n]]
    return kept
