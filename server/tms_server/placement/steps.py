"""What an event handler hands to the engine: one or more steps, each an update of the whole belief.

A handler is a generator. It checks its event first (raising ``InvalidEvent`` with nothing changed), then yields
steps; the engine applies each and sends back whether it was possible. What must happen afterwards stands after the
yield.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import NamedTuple

import numpy as np

from tms_server.placement.labels import Labels
from tms_server.placement.objects import ObjectTable
from tms_server.placement.parameters import Parameters
from tms_server.placement.state import Array, Children, Hypotheses


class Step(NamedTuple):
    """One update. ``children`` None: every hypothesis has the same likelihood ``factor`` and nothing moves.

    ``ceiling`` is the largest likelihood factor that the step can apply (for the certificate). ``merge``: children may
    coincide. ``rows``: what the children's parents index, where it is not the present rows. ``also``: objects whose
    marginals change beyond those that the children move or that are in play. ``counts``: whether its mass is part of
    the event's evidence.
    """

    children: Children | None
    factor: float = 1.0
    ceiling: float = 1.0
    merge: bool = True
    rows: Array | None = None
    also: Array | None = None
    counts: bool = True


class World(NamedTuple):
    """What handlers look at and change."""

    parameters: Parameters
    objects: ObjectTable
    labels: Labels
    belief: Hypotheses

    def alpha(self, slot: int) -> float:
        """Reliability of the reader at a label."""
        return self.parameters.alpha[self.labels[slot].kind]

    def log_kernels(self, movers: list[int], xy: tuple[float, float]) -> tuple[Array, Array]:
        """Log of K and "inside the gate" (1 or 0) of each mover, seen from ``xy`` (m)."""
        x, y = xy
        # A room has few movers: plain floats are faster than arrays here.
        d2 = [(at[0] - x) ** 2 + (at[1] - y) ** 2 for at in (self.labels[m].xy for m in movers)]
        scale = -0.5 / self.parameters.sigma_m**2
        gate = self.parameters.gate_m
        near = [1 if gate is None or math.sqrt(d) <= gate else 0 for d in d2]
        return np.array([d * scale for d in d2], np.float64), np.array(near, np.int64)


Steps = Generator[Step, bool, None]


def reweighted(belief: Hypotheses, factor: Array) -> Children:
    """The present set with each weight times ``factor`` [H]; impossible hypotheses are left out."""
    mass = belief.w * factor
    parent = np.flatnonzero(mass > 0.0).astype(np.int32)
    still = np.full(parent.size, -1, np.int32)
    return Children(parent, still, still.copy(), mass[parent], belief.zob[parent])


def cut(arrays: tuple[Array, Array, Array, Array, Array, int]) -> Children:
    """Children from a kernel's over-long arrays."""
    parent, obj, to, mass, zob, n = arrays
    return Children(parent[:n], obj[:n], to[:n], mass[:n], zob[:n])
