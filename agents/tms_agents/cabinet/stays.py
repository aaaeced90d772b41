"""The things on the board: each keeps its own load vector, and position and weight follow from that alone."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tms_agents.cabinet.events import LoadChanged, Stay
from tms_agents.cabinet.geometry import Array, Geometry, KnownWeight
from tms_agents.cabinet.position import Centre, centre

#: The share of each of several things that came together in the error of their sum, per cell.
_TOGETHER_G = 2.0


@dataclass(slots=True, eq=False)
class Thing:
    """``load`` (k,) g is what it adds to each cell, with independent errors of ``variance`` (k,) g^2."""

    id: int
    load: Array
    variance: Array
    since: float
    #: When the change began that brought it.
    onset: float
    tag: str | None = None
    #: What it weighs by itself, known from its tag.
    known: KnownWeight | None = None
    #: Ids of the things that came in the same step: only the sum of their loads is known.
    joint: frozenset[int] = frozenset()
    #: Its weight has been told; not yet where a hand might still have pressed on it.
    weighed: bool = True
    #: Position last told.
    told: tuple[float, float] = (0.0, 0.0)
    #: What the way on which the load came tells about the place: how far it is from where the load itself says, and its
    #: variance along x and y relative to what follows from ``variance``.
    aside: tuple[float, float] = (0.0, 0.0)
    sharper: tuple[float, float] = (1.0, 1.0)

    def centre(self, geometry: Geometry) -> Centre:
        at = centre(self.load, self.variance, geometry, None if self.joint else self.known)
        (a, b), (xx, xy, yy) = self.sharper, at.cov
        x = min(max(at.xy[0] + self.aside[0], 0.0), geometry.width)
        y = min(max(at.xy[1] + self.aside[1], 0.0), geometry.depth)
        return at._replace(xy=(x, y), cov=(a * xx, math.sqrt(a * b) * xy, b * yy))

    def place(self, xy: Array, variance: Array, geometry: Geometry) -> None:
        """It is known to stand at ``xy`` (2,) with errors of ``variance`` (2,) m^2; its load stays what is measured."""
        at = centre(self.load, self.variance, geometry)
        self.aside = (float(xy[0]) - at.xy[0], float(xy[1]) - at.xy[1])
        self.sharper = (float(variance[0]) / max(at.cov[0], 1e-12), float(variance[1]) / max(at.cov[2], 1e-12))

    def forget_place(self) -> None:
        """Another load: the way on which the old one came tells nothing about it."""
        self.aside, self.sharper = (0.0, 0.0), (1.0, 1.0)

    def at(self, now: float, creep_per_hour: float) -> Array:
        """Variance of the load it would take away ``now``: creep has changed it since."""
        hours = max(now - self.since, 0.0) / 3600.0
        # Small things that never matter for resting loads: hysteresis, and the edge on which a thing is lifted.
        share = creep_per_hour * hours + 0.004
        return self.variance + (share * np.abs(self.load)) ** 2


def errors_of(things: Sequence[Thing], now: float, creep_per_hour: float, cells: int) -> tuple[Array, float]:
    """Errors of the sum of the loads of ``things``: variance (k,) g^2, and variance of its total, g^2.

    Of things that came together the sum is known well. One of them alone may have stood anywhere, but weighs what its
    tag tells.
    """
    variance, total, ids = np.zeros(cells), 0.0, {thing.id for thing in things}
    for thing in things:
        own = thing.at(now, creep_per_hour)
        if thing.joint and thing.joint <= ids:
            own = own - thing.variance + _TOGETHER_G**2
        variance += own
        if thing.joint and not thing.joint <= ids and thing.known is not None:
            total += thing.known.sd_g**2 + (0.005 * thing.known.mean_g) ** 2
        else:
            total += float(own.sum())
    return variance, total


@dataclass(slots=True)
class Shelf:
    """All things on the board, by id; ids are never used again."""

    geometry: Geometry
    things: dict[int, Thing] = field(default_factory=dict)
    next_id: int = 1

    def put(self, load: Array, variance: Array, since: float, onset: float) -> Thing:
        thing = Thing(self.next_id, load, variance, since, onset)
        self.next_id += 1
        self.things[thing.id] = thing
        return thing

    def partners(self, gone: Collection[int]) -> list[Thing]:
        """Things that came together with some of those ``gone`` (ids) and are still there."""
        return [thing for thing in self.things.values() if thing.id not in gone and thing.joint & set(gone)]

    def tell_apart(self, partners: Sequence[Thing], gone: Collection[int], left: Array, variance: Array) -> None:
        """Others of their group have gone: what those weighed less than thought, ``left`` (k,), these weigh more."""
        for thing in partners:
            thing.load, thing.joint = thing.load + left / len(partners), thing.joint - set(gone)
            if len(partners) == 1:
                thing.variance, thing.joint = 2 * variance, frozenset()
            thing.forget_place()

    def join(self, now: float, things: Sequence[Thing], gone: Collection[int] = ()) -> LoadChanged:
        """Of these only the sum is known from ``now`` on; those ``gone`` belonged to some of them."""
        for thing in things:
            others = {other.id for other in things if other is not thing}
            thing.joint = (thing.joint | others) - set(gone)
        errors, _ = errors_of(things, now, 0.0, self.geometry.count)
        weight_g = sum(float(thing.load.sum()) for thing in things)
        return LoadChanged(now, tuple(thing.id for thing in things), weight_g, math.sqrt(float(errors.sum())))

    def tagged(self, tag: str) -> Thing | None:
        return next((thing for thing in self.things.values() if thing.tag == tag), None)

    def stays(self) -> list[Stay]:
        return [self._stay(thing) for thing in self.things.values()]

    def total(self) -> Array:
        """Sum of all loads, (k,) g: what the cells show above their zero."""
        return sum((thing.load for thing in self.things.values()), np.zeros(self.geometry.count))

    def _stay(self, thing: Thing) -> Stay:
        at = thing.centre(self.geometry)
        return Stay(thing.id, at.xy, at.cov, at.weight_g, at.weight_sd_g, thing.tag, thing.since)

    def to_dict(self) -> dict[str, Any]:
        return {
            "next_id": self.next_id,
            "things": [
                {
                    "id": thing.id,
                    "load": thing.load.tolist(),
                    "variance": thing.variance.tolist(),
                    "since": thing.since,
                    "onset": thing.onset,
                    "tag": thing.tag,
                    "known": None if thing.known is None else [thing.known.mean_g, thing.known.sd_g],
                    "joint": sorted(thing.joint),
                    "weighed": thing.weighed,
                    "told": list(thing.told),
                    "placed": [*thing.aside, *thing.sharper],
                }
                for thing in self.things.values()
            ],
        }

    @classmethod
    def from_dict(cls, geometry: Geometry, state: dict[str, Any]) -> Shelf:
        shelf = cls(geometry, next_id=int(state["next_id"]))
        for item in state["things"]:
            load, variance = np.array(item["load"], dtype=float), np.array(item["variance"], dtype=float)
            if load.shape != (geometry.count,) or variance.shape != load.shape or not math.isfinite(load.sum()):
                raise ValueError(f"stay {item['id']} was saved for a board with other cells")
            shelf.things[int(item["id"])] = Thing(
                id=int(item["id"]),
                load=load,
                variance=variance,
                since=float(item["since"]),
                onset=float(item["onset"]),
                tag=item["tag"],
                known=None if item["known"] is None else KnownWeight(*item["known"]),
                joint=frozenset(item["joint"]),
                weighed=bool(item.get("weighed", True)),
                told=(float(item["told"][0]), float(item["told"][1])),
                aside=_pair(item.get("placed", (0, 0))[:2]),
                sharper=_pair(item.get("placed", (0, 0, 1, 1))[2:]),
            )
        return shelf


def _pair(values: Sequence[float]) -> tuple[float, float]:
    return float(values[0]), float(values[1])
