"""What a record can say: an observation, or a change of the room's registry (its objects, the room itself)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter

from tms_schemas.base import Model, Tag
from tms_schemas.maps import MapId, Version
from tms_schemas.observation import Observation
from tms_schemas.rooms import RoomIn


class TrackedObject(Model):
    """All that the belief knows of an object. Weights in grams; ``size_m`` the width that a laser sees (metres)."""

    tag: Tag
    name: str
    weight_g: float | None = None
    weight_sd_g: float = 0.0
    size_m: float | None = None


class ObjectRegistered(TrackedObject):
    """The room tracks the object from now on (or from before its tag was first seen as unknown)."""

    type: Literal["object_registered"] = "object_registered"


class ObjectChanged(TrackedObject):
    """The whole new state of the object, not only what changed."""

    type: Literal["object_changed"] = "object_changed"


class ObjectRemoved(Model):
    """The room tracks the object no more."""

    type: Literal["object_removed"] = "object_removed"
    tag: Tag


class RoomChanged(Model):
    """The room was made or changed; ``room`` is its whole new state."""

    type: Literal["room_changed"] = "room_changed"
    room: RoomIn


class MapChanged(Model):
    """A map of the room was made or changed, or has a new version; ``version`` null: it was deleted.

    No belief depends on it; it is here for those who follow the room.
    """

    type: Literal["map_changed"] = "map_changed"
    map: MapId
    version: Version | None


RegistryBody = ObjectRegistered | ObjectChanged | ObjectRemoved | RoomChanged | MapChanged
registry_body: TypeAdapter[RegistryBody] = TypeAdapter(Annotated[RegistryBody, Field(discriminator="type")])


class Unreadable(Model):
    """What an older or newer version wrote and this one does not understand: ``kind`` as far as it can be told."""

    type: Literal["unreadable"] = "unreadable"
    kind: str
    why: str


Content = Observation | RegistryBody | Unreadable
