"""Rounds of the tag reader in a recording: also the empty ones, for what was not read is evidence, too."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Rounds:
    """``t`` (R,) s, not falling; ``antenna`` (R,); ``tags`` read in each round."""

    t: Floats
    antenna: NDArray[np.int64]
    tags: tuple[frozenset[str], ...]

    def read(self, tag: str) -> NDArray[np.bool_]:
        """(R,) whether ``tag`` was read."""
        return np.array([tag in tags for tags in self.tags], dtype=np.bool_)


def parse_rounds(lines: Iterable[str]) -> tuple[Rounds, int]:
    """Records of type ``rfid`` (``t``, ``antenna``, ``tags`` with ``id``), in order of time, and how many were bad."""
    found: list[tuple[float, int, frozenset[str]]] = []
    bad = 0
    for line in lines:
        if '"rfid"' not in line:
            continue
        try:
            record = json.loads(line)
            if record["type"] != "rfid":
                continue
            t = float(record["t"])
            if not math.isfinite(t):
                raise ValueError("not finite")
            found.append((t, int(record["antenna"]), frozenset(str(one["id"]) for one in record["tags"])))
        except (ValueError, KeyError, TypeError, RecursionError, OverflowError):
            bad += 1
    found.sort(key=lambda one: one[0])
    return Rounds(
        np.array([one[0] for one in found], dtype=np.float64),
        np.array([one[1] for one in found], dtype=np.int64),
        tuple(one[2] for one in found),
    ), bad
