"""From a board's stays to position labels of the room, and from its events to observations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from datetime import datetime

from tms_agents.cabinet import (
    Appeared,
    CabinetEvent,
    Identified,
    LoadChanged,
    Moved,
    Stay,
    Vanished,
    Weighed,
    ZoneRead,
)
from tms_agents.cabinet.frames import BoardPose, Covariance
from tms_schemas.observation import (
    InventoryLabel,
    LabelAppeared,
    LabelMoved,
    LabelVanished,
    LoadChange,
    Observation,
    RawRead,
    TagObserved,
)

#: A covariance smaller than this claims more than any installer measures (a millimetre).
_LEAST_VARIANCE = 1e-6


class Labels:
    """The labels of one board's stays. ``utc`` tells the time of day of a sensor time, ``new_label`` a fresh id.

    ``anywhere`` replaces the covariance of a board that does not know positions.
    """

    def __init__(
        self,
        pose: BoardPose,
        new_label: Callable[[], str],
        utc: Callable[[float], datetime],
        *,
        anywhere: Covariance | None = None,
    ) -> None:
        self._pose, self._new_label, self._utc, self._anywhere = pose, new_label, utc, anywhere
        #: Label id by stay id, of stays that are on the board.
        self.of: dict[int, str] = {}

    def observations(self, events: Sequence[CabinetEvent]) -> list[Observation]:
        """In time, and what happened at one instant in the order of the wire: vanish, move, appear, read.

        A tag that is known at the moment of appearing goes with the appearance.
        """
        ordered = sorted(events, key=lambda event: (event.t, _rank(event)))
        tags = {(one.t, one.stay): one.tag for one in ordered if isinstance(one, Identified)}
        appeared = {(one.t, one.stay) for one in ordered if isinstance(one, Appeared)}
        made: list[Observation] = []
        for event in ordered:
            if isinstance(event, Identified) and (event.t, event.stay) in appeared:
                continue
            tag = tags.get((event.t, event.stay)) if isinstance(event, Appeared) else None
            if (observation := self._observation(event, tag)) is not None:
                made.append(observation)
        return made

    def inventory(self, stays: Iterable[Stay]) -> list[InventoryLabel]:
        """Every stay with its label; a stay without one (a state older than the estimator's) gets one."""
        listed = list(stays)
        self.of = {one.id: self.of.get(one.id) or self._new_label() for one in listed}
        return [
            InventoryLabel(label=self.of[one.id], kind="cabinet", tag=one.tag, **self._place(one.xy, one.cov))
            for one in listed
        ]

    def _observation(self, event: CabinetEvent, tag: str | None) -> Observation | None:
        at = self._utc(event.t)
        if isinstance(event, ZoneRead):
            return RawRead(seq=0, observed_at=at, zone=event.zone, tag=event.tag)
        if isinstance(event, Appeared):
            label = self.of[event.stay] = self._new_label()
            told = self._place(event.xy, event.cov)
            if not event.pressed:
                told["weight_g"] = _grams(event.weight_g)
            if tag is not None:
                told["tag"] = tag
            return LabelAppeared(seq=0, observed_at=at, label=label, kind="cabinet", **told)
        if isinstance(event, LoadChanged):
            labels = [self.of[stay] for stay in event.stays if stay in self.of]
            weight = round(event.weight_g, 3)
            return LoadChange(seq=0, observed_at=at, labels=labels, weight_g=weight) if labels else None
        named = self.of.get(event.stay)
        if named is None:
            return None
        if isinstance(event, Vanished):
            del self.of[event.stay]
            return LabelVanished(seq=0, observed_at=at, label=named, weight_g=_grams(event.weight_g))
        if isinstance(event, Weighed):
            return LoadChange(seq=0, observed_at=at, labels=[named], weight_g=_grams(event.weight_g))
        if isinstance(event, Moved):
            return LabelMoved(seq=0, observed_at=at, label=named, **self._place(event.xy, event.cov))
        return TagObserved(seq=0, observed_at=at, label=named, tag=event.tag)

    def _place(self, xy: tuple[float, float], cov: Covariance) -> dict[str, object]:
        pose = self._pose
        xx, xy_, yy = pose.covariance(cov if self._anywhere is None else self._anywhere)
        x, y = pose.point(xy)
        placed: dict[str, object] = {
            "xy": (round(x, 4), round(y, 4)),
            "cov": (max(xx, _LEAST_VARIANCE), xy_, max(yy, _LEAST_VARIANCE)),
        }
        if pose.z is not None:
            placed["z"] = pose.z
        if pose.surface is not None:
            placed["surface"] = pose.surface
        return placed


_RANKS: dict[type, int] = {Vanished: 1, Moved: 2, Appeared: 3, Weighed: 4, Identified: 5, ZoneRead: 6}


def _rank(event: CabinetEvent) -> int:
    if isinstance(event, LoadChanged):
        return 0 if event.weight_g < 0 else 4
    return _RANKS[type(event)]


def _grams(weight: float) -> float:
    return round(max(0.0, abs(weight)), 3)
