"""Movers that an agent knew only by where they were: the nearest one at that time."""

from __future__ import annotations

from collections.abc import Mapping

from tms_schemas import events
from tms_schemas.events import MoverRef, Near
from tms_server.town.geometry import distance2
from tms_server.town.state import LabelInfo

#: Nobody farther away is meant, metres.
REACH_M = 1.5


class UnknownMover(Exception):
    """Nobody was there, and the event says nothing without knowing who."""


def resolved(event: events.Event, labels: Mapping[str, LabelInfo]) -> events.Event:
    """The event with every ``Near`` replaced by a label.

    Who took or put a thing may stay unknown (then any mover may have); a hand-over needs both.

    Raises:
        UnknownMover
    """
    match event:
        case events.LabelAppeared(source=Near() as near):
            return event.model_copy(update={"source": _nearest(near, labels)})
        case events.LabelVanished(dest=Near() as near):
            return event.model_copy(update={"dest": _nearest(near, labels)})
        case events.Handover():
            giver, taker = _pair(event.from_, event.to, labels)
            return event.model_copy(update={"from_": giver, "to": taker})
        case events.HandoverPossible():
            a, b = _pair(event.a, event.b, labels)
            return event.model_copy(update={"a": a, "b": b})
    return event


def _pair(first: MoverRef, second: MoverRef, labels: Mapping[str, LabelInfo]) -> tuple[str, str]:
    """Two different movers. One that is named goes first: it cannot be the one that is near."""
    if isinstance(first, Near) and isinstance(second, str):
        b, a = _pair(second, first, labels)
        return a, b
    one = first if isinstance(first, str) else _nearest(first, labels)
    if one is None:
        raise UnknownMover(f"nobody within {REACH_M} m")
    other = second if isinstance(second, str) else _nearest(second, labels, but=one)
    if other is None:
        raise UnknownMover(f"nobody but {one} within {REACH_M} m")
    return one, other


def _nearest(near: Near, labels: Mapping[str, LabelInfo], but: str | None = None) -> str | None:
    found = [
        (d2, name)
        for name, info in labels.items()
        if info.kind == "mover" and name != but and (d2 := distance2(near.xy, info.xy)) <= REACH_M**2
    ]
    return min(found)[1] if found else None
