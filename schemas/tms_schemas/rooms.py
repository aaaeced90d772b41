"""Rooms: a metric frame (x right/east, y up/north), its outline, furniture with surfaces, and sensors."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, model_validator

from tms_schemas.base import AgentId, Metres, Model, Name, Polygon, Pose, RoomId, UtcTime

PlaceId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]


class Surface(Model):
    """A place on furniture where things can lie: a shelf, a table top."""

    id: PlaceId
    name: Name | None = None
    polygon: Polygon
    z: Metres = 0.0


class Furniture(Model):
    id: PlaceId
    name: Name
    polygon: Polygon
    surfaces: Annotated[list[Surface], Field(max_length=100)] = []
    #: The agent that instruments it (a smart cabinet), if any.
    agent: AgentId | None = None


class Zone(Model):
    """What one antenna covers, for ``raw_read``: labels whose position lies inside."""

    id: PlaceId
    polygon: Polygon


class Sensor(Model):
    """Where an agent's sensor is, and the zones of its antennas."""

    agent: AgentId
    kind: Name
    pose: Pose | None = None
    zones: Annotated[list[Zone], Field(max_length=100)] = []


class RoomIn(Model):
    name: Name
    #: What the frame is tied to, in words: "origin at the south-west corner".
    frame: Annotated[str, Field(max_length=500)] = ""
    outline: Polygon
    furniture: Annotated[list[Furniture], Field(max_length=500)] = []
    sensors: Annotated[list[Sensor], Field(max_length=200)] = []
    #: Overrides of the belief parameters of the profile ``live``.
    params: dict[str, Any] = {}
    #: Seed of the room's random draws.
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0

    @model_validator(mode="after")
    def _unique(self) -> RoomIn:
        for what, ids in (
            ("furniture", [f.id for f in self.furniture]),
            ("agent of a sensor", [s.agent for s in self.sensors]),
            *((f"surface of {f.id}", [s.id for s in f.surfaces]) for f in self.furniture),
        ):
            if len(set(ids)) != len(ids):
                raise ValueError(f"{what}: listed twice")
        return self


class Room(RoomIn):
    id: RoomId
    created_at: UtcTime
    updated_at: UtcTime


class RoomPage(Model):
    items: list[Room]
    next_cursor: str | None = None
