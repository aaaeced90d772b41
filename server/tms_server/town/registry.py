"""Registry records folded: what the room tracks, and how its belief is parameterised."""

from __future__ import annotations

from tms_server.log.bodies import ObjectRemoved, RegistryBody, RoomChanged, TrackedObject
from tms_server.placement import ObjectSpec, ParameterError, Parameters
from tms_server.town.folding import Folding


def apply(fold: Folding, body: RegistryBody) -> None:
    match body:
        case ObjectRemoved(tag=tag):
            if fold.state.names.pop(tag, None) is not None:
                if fold.state.unseen.pop(tag, None) is None:
                    fold.engine.remove_object(tag)
                fold.state.evidence.pop(tag, None)
        case RoomChanged(room=room):
            fold.state.room = room
            try:
                fold.engine.set_parameters(Parameters.of(room.params, profile="live"))
            except ParameterError as error:
                fold.note("parameters", f"{error}; the room keeps those it had")
        case TrackedObject():
            spec = ObjectSpec(
                id=body.tag,
                tag=body.tag,
                weight_g=body.weight_g,
                weight_sd_g=body.weight_sd_g,
                size_m=body.size_m,
            )
            if body.tag in fold.state.names and body.tag not in fold.state.unseen:
                fold.engine.change_object(spec)
            else:
                fold.state.unseen[body.tag] = spec
            fold.state.names[body.tag] = body.name
