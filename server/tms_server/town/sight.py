"""Things that come into a room unseen, and things that are seen in it for the first time.

A tracked object that no reader here ever named is outside, certainly; the belief engine carries it only from its first
read on. So a catalogue of thousands costs nothing, and the first read of a thing is believed: somebody brought it.
"""

from __future__ import annotations

from collections.abc import Sequence

from tms_schemas import events
from tms_server.town.folding import Folding

#: Probability that a thing came from outside where nobody was there to bring it, or to see who did.
P_UNSEEN = 0.5


def is_first(event: events.Event, fold: Folding) -> bool:
    """Whether ``event`` is a label whose content probably came from outside.

    Either a reader names a thing that was never seen here, or no mover is known: rooms with cabinets and no floor
    sensor live by that. Objects that the event shows for the first time are given to the belief engine.
    """
    match event:
        case events.LabelAppeared():
            first = event.tag is not None and _introduce(event.tag, [], fold)
            return first or not any(info.kind == "mover" for info in fold.state.labels.values())
        case events.TagObserved():
            _introduce(event.tag, [event.label] if event.label is not None else event.labels or [], fold)
        case events.Handover(tag=str(tag), from_=str(giver)):
            _introduce(tag, [giver], fold)
        case events.Correction(present=True):
            _introduce(event.tag, [event.label], fold)
    return False


def as_content(event: events.Event, fold: Folding) -> events.Event:
    """The event for the engine, to which a tag that is not registered says nothing.

    A new label whose reader names such a tag holds something unregistered, most likely: no tracked object was read.
    """
    if isinstance(event, events.LabelAppeared) and event.tag is not None and event.tag not in fold.state.names:
        return event.model_copy(update={"tag": None})
    return event


def _introduce(tag: str, labels: Sequence[str], fold: Folding) -> bool:
    """Give an object to the engine: outside, or as probably at one of ``labels``. False where the engine has it."""
    spec = fold.state.unseen.pop(tag, None)
    if spec is None:
        return False
    active = [label for label in labels if fold.state.active(label) is not None]
    fold.engine.add_object(spec, {label: P_UNSEEN / len(active) for label in active})
    return True
