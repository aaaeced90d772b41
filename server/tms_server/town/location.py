"""The answer for a robot: where is this thing, how sure, why, since when."""

from __future__ import annotations

from typing import NamedTuple

from tms_schemas.belief import OUTSIDE, DirectEvidence, LocationAnswer, PlaceProbability, Share
from tms_server.db.times import from_us
from tms_server.town.places import inside_room
from tms_server.town.views import RoomView, entropy_bits


class KnownObject(NamedTuple):
    """What the object database says of the thing asked for."""

    tag: str
    name: str
    room: str | None
    tracking: str


def location(thing: KnownObject, view: RoomView) -> LocationAnswer:
    """Where a tracked object is, as its room tells it at one instant."""
    state = view.fold.state
    if thing.tag not in state.names:
        return _untracked(thing, view)
    marginal = view.marginal(thing.tag)
    evidence = state.evidence.get(thing.tag)
    seen = None
    if evidence is not None:
        seen = DirectEvidence(
            agent=evidence.agent,
            seq=evidence.seq,
            type=evidence.kind,
            label=evidence.label,
            observed_at=from_us(evidence.observed_at),
        )
    here = inside_room(marginal)
    name = state.room.name if state.room else None
    return LocationAnswer(
        tag=thing.tag,
        name=thing.name,
        room=thing.room,
        at=view.at,
        cursor=view.cursor,
        distribution=view.places.distribution(marginal),
        furniture=view.places.by_furniture(marginal),
        holders=view.places.by_holder(marginal),
        rooms=[Share(id=view.room, name=name, p=here)] if here > 0 else [],
        best=view.places.best(marginal),
        entropy_bits=entropy_bits(marginal),
        last_direct_evidence=seen,
        staleness_s=None if seen is None or view.at is None else (view.at - seen.observed_at).total_seconds(),
        contradiction=state.contradiction,
    )


def nowhere(thing: KnownObject) -> LocationAnswer:
    """An object that no room tracks is outside all of them."""
    return LocationAnswer(
        tag=thing.tag,
        name=thing.name,
        room=None,
        at=None,
        cursor=0,
        distribution=[PlaceProbability(label=OUTSIDE, p=1.0, kind="outside")],
        furniture=[],
        holders=[],
        rooms=[],
        best=None,
        entropy_bits=0.0,
        last_direct_evidence=None,
        staleness_s=None,
    )


def _untracked(thing: KnownObject, view: RoomView) -> LocationAnswer:
    """Not tracked at that instant: a thing of the map stands in its room, any other was still outside."""
    answer = nowhere(thing)
    answer.room, answer.at, answer.cursor = thing.room, view.at, view.cursor
    if thing.tracking == "map":
        answer.distribution, answer.rooms = [], [Share(id=view.room, p=1.0)]
    return answer
