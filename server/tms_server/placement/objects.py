"""The tracked objects as arrays, one entry per object, in the order of registration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from tms_server.placement.kernels import content_likelihoods
from tms_server.placement.parameters import Parameters
from tms_server.placement.specs import ObjectSpec

#: ``read`` of ``ObjectTable.likelihoods``: the reader saw nothing; there is no reader.
NOTHING, NO_READER = -1, -2


class ObjectTable:
    """Specs and what the likelihoods need of them. Immutable; a change makes a new table.

    Raises:
        ValueError: two objects share an id or a tag, or a number is out of range.
    """

    def __init__(self, specs: Sequence[ObjectSpec], parameters: Parameters) -> None:
        self.specs = tuple(specs)
        self.ids = [s.id for s in specs]
        self.index = {s.id: i for i, s in enumerate(specs)}
        self.by_tag = {s.tag.upper(): i for i, s in enumerate(specs) if s.tag is not None}
        self.tagged = np.array([s.tag is not None for s in specs], np.bool_)
        if len(self.index) != len(specs):
            raise ValueError("object ids are not unique")
        if len(self.by_tag) != int(self.tagged.sum()):
            raise ValueError("two objects carry the same tag")
        for s in specs:
            _check(s)
        self.n_tags = max(len(self.by_tag), 1)
        self.weight_g = np.array([math.nan if s.weight_g is None else s.weight_g for s in specs], np.float64)
        self.weight_sd = np.array([s.weight_sd_g for s in specs], np.float64)
        self.size_m = np.array([math.nan if s.size_m is None else s.size_m for s in specs], np.float64)
        self.p_read = np.array(
            [
                1.0 if not parameters.use_null_reads else parameters.p_read if s.p_read is None else s.p_read
                for s in specs
            ],
            np.float64,
        )
        self._parameters = parameters
        self.none = np.ones(len(specs) + 1)

    def __len__(self) -> int:
        return len(self.specs)

    def likelihoods(
        self,
        read: int = NO_READER,
        alpha: float = 1.0,
        weight_g: float | None = None,
        size_m: float | None = None,
    ) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """Likelihood of what was measured at a label, given its content: [N + 1], the last for EMPTY."""
        p = self._parameters
        grams = weight_g if weight_g is not None and p.use_weight else math.nan
        width = size_m if size_m is not None and p.use_size else math.nan
        if read == NO_READER and grams != grams and width != width:
            return self.none
        likelihood: np.ndarray[tuple[int], np.dtype[np.float64]] = content_likelihoods(
            self.weight_g, self.weight_sd, self.size_m, self.p_read, self.tagged,
            read, float(alpha), self.n_tags, float(grams), p.weight_sd_g, p.weight_range_g,
            float(width), p.size_sd_m, p.size_range_m,
        )  # fmt: skip
        return likelihood

    def to_json(self) -> list[dict[str, Any]]:
        """The specs as plain JSON types."""
        return [asdict(s) for s in self.specs]

    def read_of(self, tag: str | None) -> int:
        """What a reader's report means: an object's index, NOTHING or NO_READER (also for unregistered tags)."""
        if tag is None:
            return NOTHING if self._parameters.use_null_reads else NO_READER
        return self.by_tag.get(tag, NO_READER)


def _check(spec: ObjectSpec) -> None:
    for name, low, high in (
        ("weight_g", 0.0, 1e9),
        ("weight_sd_g", 0.0, 1e9),
        ("size_m", 0.0, 1e6),
        ("p_read", 0.0, 1.0),
    ):
        value = getattr(spec, name)
        if value is not None and not low <= value <= high:
            raise ValueError(f"object {spec.id}: {name} must be between {low:g} and {high:g}, got {value!r}")
