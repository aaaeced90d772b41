"""One instant of one room, and the answers it gives."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property

from tms_schemas.belief import (
    AnomaliesAnswer,
    Anomaly,
    LabelsAnswer,
    LabelView,
    MoversAnswer,
    MoverView,
    ObjectPlacement,
    PlacementsAnswer,
)
from tms_server.db.times import from_us, to_us
from tms_server.errors import NotFound
from tms_server.town.actor import Frozen
from tms_server.town.fold import RoomFold
from tms_server.town.places import Places
from tms_server.town.state import LabelInfo

#: Probabilities below this are no slice of a pie.
_SLIVER = 1e-9


@dataclass(frozen=True, kw_only=True)
class RoomView:
    """The room as the log up to offset ``cursor`` tells it; never changes.

    Args:
        frozen: the folded state.
        asked: the instant asked for; None is the newest.
        now: the time of asking, against which silence is judged where ``asked`` is None.
        silent_after_s, patience_s: see ``Settings``.
    """

    room: str
    frozen: Frozen
    asked: datetime | None
    now: datetime
    silent_after_s: float
    patience_s: float

    @property
    def fold(self) -> RoomFold:
        return self.frozen.fold

    @property
    def cursor(self) -> int:
        """Offset of the newest log record that the answers know."""
        return self.frozen.cursor

    @cached_property
    def at(self) -> datetime | None:
        """The instant the answers speak of: the one asked for, or that of the newest observation."""
        if self.asked is not None:
            return self.asked
        newest = max((info.last for info in self.fold.state.agents.values()), default=None)
        return None if newest is None else from_us(newest)

    @property
    def tags(self) -> list[str]:
        """Tags of the objects that the room tracks, in order."""
        return sorted(self.fold.state.names)

    def marginal(self, tag: str) -> dict[str, float]:
        """Label -> probability of one object (``OUT`` is no label); KeyError where the room does not track it."""
        marginals = self.frozen.marginals
        if tag not in marginals:
            found = self.fold.marginal(tag)
            marginals[tag] = {label: p for label, p in found.items() if p >= _SLIVER}
        return marginals[tag]

    def placements(self, tags: Iterable[str] | None = None) -> PlacementsAnswer:
        """The pies of all objects, or of some."""
        objects = [self.placement(tag) for tag in (self.tags if tags is None else tags)]
        return PlacementsAnswer(room=self.room, at=self.at, cursor=self.cursor, objects=objects)

    def placement(self, tag: str) -> ObjectPlacement:
        """One pie, the largest slice first."""
        if tag not in self.fold.state.names:
            raise NotFound(f"room {self.room} does not track the object {tag}")
        marginal = self.marginal(tag)
        return ObjectPlacement(
            tag=tag,
            name=self.fold.state.names[tag],
            distribution=self.places.distribution(marginal),
            entropy_bits=entropy_bits(marginal),
        )

    def labels(self) -> LabelsAnswer:
        """All labels but movers, ghosts included."""
        labels = [self._label(name, info) for name, info in self.fold.state.labels.items() if info.kind != "mover"]
        return LabelsAnswer(room=self.room, at=self.at, cursor=self.cursor, labels=labels)

    def movers(self) -> MoversAnswer:
        """Persons and robots. What a robot grips counts as held by it."""
        held: dict[str, dict[str, float]] = {}
        for label, contents in self._contents.items():
            holder = self.places.holder(label)
            if holder is not None:
                mine = held.setdefault(holder, {})
                for tag, p in contents.items():
                    mine[tag] = mine.get(tag, 0.0) + p
        movers = [
            self._mover(name, info, held.get(name, {}))
            for name, info in self.fold.state.labels.items()
            if info.kind == "mover"
        ]
        return MoversAnswer(room=self.room, at=self.at, cursor=self.cursor, movers=movers)

    def anomalies(self) -> AnomaliesAnswer:
        """What the log contains and the model did not expect, the newest last."""
        found = [
            (fault.observed_at, kind, agent, detail, fault.seq)
            for (kind, agent, detail), fault in self.fold.state.anomalies.items()
        ]
        # A label that vanished before it appeared is odd only once its announcement had time to arrive.
        patience_us = round(self.patience_s * 1e6)
        found += [
            (fault.observed_at, "unknown_label", agent, f"{label} vanished but never appeared", fault.seq)
            for (agent, label), fault in self.fold.state.unannounced.items()
            if fault.observed_at + patience_us <= self.places.reference
        ]
        items = [
            Anomaly(kind=kind, detail=detail, agent=agent, seq=seq, observed_at=from_us(observed_at))
            for observed_at, kind, agent, detail, seq in sorted(found)
        ]
        return AnomaliesAnswer(room=self.room, cursor=self.cursor, anomalies=items)

    @cached_property
    def places(self) -> Places:
        reference = to_us(self.asked or self.now)
        return Places(self.fold.state, reference=reference, silent_after_us=round(self.silent_after_s * 1e6))

    @cached_property
    def _contents(self) -> dict[str, dict[str, float]]:
        contents: dict[str, dict[str, float]] = {}
        for tag in self.tags:
            for label, p in self.marginal(tag).items():
                contents.setdefault(label, {})[tag] = p
        return contents

    def _label(self, name: str, info: LabelInfo) -> LabelView:
        furniture, surface = self.places.furniture(info)
        return LabelView(
            label=name,
            kind=info.kind,
            agent=info.agent,
            xy=info.xy,
            z=info.z,
            theta=info.theta,
            cov=info.cov,
            furniture=furniture,
            surface=surface,
            since=from_us(info.since),
            updated_at=from_us(info.updated),
            stale=self.places.stale(info),
            ghost=info.ghost,
            put_by_robot=info.put_by_robot,
            weight_g=info.weight_g,
            contents=self._contents.get(name, {}),
        )

    def _mover(self, name: str, info: LabelInfo, holds: dict[str, float]) -> MoverView:
        return MoverView(
            label=name,
            agent=info.agent,
            xy=info.xy,
            theta=info.theta,
            since=from_us(info.since),
            updated_at=from_us(info.updated),
            stale=self.places.stale(info),
            expected_objects=math.fsum(holds.values()),
            holds=holds,
        )


def entropy_bits(marginal: Mapping[str, float]) -> float:
    """Entropy of one object's place."""
    return max(0.0, -math.fsum(p * math.log2(p) for p in marginal.values() if p > 0))
