"""Requests for scans, as the host sends them and the sensor repeats them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, cast

Code = Literal["GD", "GS", "GE", "MD", "MS", "ME"]
_MEASURE = re.compile(
    r"(?:(G[DSE])(\d{4})(\d{4})(\d{2})|(M[DSE])(\d{4})(\d{4})(\d{2})(\d)(\d{2}))(?:;(.{0,16}))?", re.A
)
_OLD = re.compile(r"G(\d{3})(\d{3})(\d{2})", re.A)


@dataclass(frozen=True, slots=True)
class Measure:
    """SCIP 2: ``G`` for one scan, ``M`` for ``count`` of them (0: for ever), leaving out ``skip`` after each.

    ``D`` three characters per distance, ``S`` two, ``E`` three and three for the intensity. Steps ``start`` to ``end``
    (inclusive), ``cluster`` of them give one value, their nearest.
    """

    code: Code
    start: int
    end: int
    cluster: int = 1
    skip: int = 0
    count: int = 0
    text: str = ""

    def encode(self) -> str:
        """The command without its line feed."""
        more = f"{self.skip}{self.count:02d}" if self.code[0] == "M" else ""
        text = f";{self.text}" if self.text else ""
        return f"{self.code}{self.start:04d}{self.end:04d}{self.cluster:02d}{more}{text}"

    @classmethod
    def parse(cls, command: str) -> Measure | None:
        """None for all other commands. A cluster of 0 means 1."""
        found = _MEASURE.fullmatch(command)
        if found is None:
            return None
        once, *single, many, start, end, cluster, skip, count, text = found.groups()
        if once:
            return cls(cast(Code, once), int(single[0]), int(single[1]), int(single[2]) or 1, text=text or "")
        return cls(cast(Code, many), int(start), int(end), int(cluster) or 1, int(skip), int(count), text or "")

    @property
    def beams(self) -> int:
        """Values per scan; the last may be of fewer steps."""
        return max(-(-(self.end - self.start + 1) // self.cluster), 0)

    @property
    def width(self) -> int:
        """Characters per value."""
        return 2 if self.code[1] == "S" else 3

    @property
    def characters(self) -> int:
        """Characters of data per scan."""
        return self.beams * self.width * (2 if self.code[1] == "E" else 1)


@dataclass(frozen=True, slots=True)
class OldMeasure:
    """SCIP 1.1: one scan, two characters per distance."""

    start: int
    end: int
    cluster: int = 1

    def encode(self) -> str:
        return f"G{self.start:03d}{self.end:03d}{self.cluster:02d}"

    @classmethod
    def parse(cls, command: str) -> OldMeasure | None:
        found = _OLD.fullmatch(command)
        return None if found is None else cls(int(found[1]), int(found[2]), int(found[3]) or 1)

    @property
    def beams(self) -> int:
        return max(-(-(self.end - self.start + 1) // self.cluster), 0)

    @property
    def characters(self) -> int:
        return 2 * self.beams
