"""Prints for tests, what rests on the floor as the estimator keeps it; and scans that show it."""

from __future__ import annotations

import numpy as np

from tms_agents.floor.scan.clustered import ClusteredScan
from tms_agents.floor.state import PRINT, empty

NOW = 100.0


def resting(seconds: float, width: float = 0.1, **fields: float) -> np.ndarray:
    """A print in full sight since so long, that nobody came near."""
    prints = empty(PRINT, 1)
    hits = round(10 * seconds) + 1
    values = {"used": 1, "first": NOW - seconds, "rested": NOW - seconds, "last": NOW, "width": width, "owner": -1}
    values |= {"hits": hits, "looks": hits, "whole": hits, "beams": 8, "spacing": 0.01, "whose": -1}
    values |= {"owned": -1e9, "busy": -1e9, "silent": -1e9, "hidden": -1e9}
    for name, value in (values | fields).items():
        prints[name] = value
    return prints


def shows(clusters: np.ndarray, prints: np.ndarray, t: float = NOW, print_: int = -1) -> ClusteredScan:
    """A scan of these clusters, all on one print (-1: on none), that tells nothing of how they echo."""
    return ClusteredScan(clusters, np.full(clusters.size, print_), np.zeros((clusters.size, 4)), prints, t)
