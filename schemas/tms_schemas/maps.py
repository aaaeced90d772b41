"""Maps: occupancy grids with an intensity layer and the semi-dynamic objects in them, versioned, sent tile by tile."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, WithJsonSchema, model_validator

from tms_schemas.base import AgentId, Metres, Model, Name, Pose, RoomId, Tag, UtcTime, Xy
from tms_schemas.tiles import MAX_TEXT

#: No dots, so that ``.png`` behind it is no part of it.
MapId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")]
Version = Annotated[int, Field(ge=0, lt=2**31)]
#: In tiles from the one at the origin.
TileIndex = Annotated[int, Field(ge=-(2**20), lt=2**20)]
#: SHA-256 of a tile's content.
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
TileText = Annotated[str, Field(min_length=1, max_length=MAX_TEXT, description="base64 of a packed tile")]
#: x0, y0, x1, y1 in cells from the origin, the upper ends excluded.
CellBounds = Annotated[
    tuple[int, int, int, int],
    WithJsonSchema({"type": "array", "items": {"type": "integer"}, "minItems": 4, "maxItems": 4}),
]


class MapIn(Model):
    """``resolution`` and ``origin`` place the cells and stay once there is a version."""

    room: RoomId
    name: Name | None = None
    #: Metres per cell.
    resolution: Annotated[float, Field(ge=0.001, le=10)]
    #: Lower left corner of cell (0, 0) in the map frame.
    origin: Xy = (0.0, 0.0)
    #: Pose of the map frame in the room frame; null while nobody knows it.
    map_to_room: Pose | None = None


class TownMap(MapIn):
    id: MapId
    #: The newest version, 0 before the first.
    version: Version
    created_at: UtcTime
    updated_at: UtcTime


class MapPage(Model):
    items: list[TownMap]
    next_cursor: str | None = None


class MapObject(Model):
    """A semi-dynamic object as it stood when the version was made, in the map frame."""

    tag: Tag
    x: Metres
    y: Metres
    theta: Annotated[float, Field(ge=-1e3, le=1e3)]
    #: What it is in: a door may be "open" or "closed".
    state: Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[^\x00]+$")] | None = None
    #: How far a door is turned from where it is closed (rad, counter-clockwise).
    angle: Annotated[float, Field(ge=-1e3, le=1e3)] | None = None
    #: When the robot last had it before its sensors.
    seen_at: UtcTime | None = None


class TileIn(Model):
    """A tile of the new version: packed, or by the digest of one that this map has or was sent before."""

    x: TileIndex
    y: TileIndex
    data: TileText | None = None
    digest: Digest | None = None

    @model_validator(mode="after")
    def _one(self) -> TileIn:
        if (self.data is None) == (self.digest is None):
            raise ValueError("a tile comes with either data or digest")
        return self


class TilePlace(Model):
    x: TileIndex
    y: TileIndex


class VersionIn(Model):
    """What changed since ``base``, which must be the newest version (0: there is none yet)."""

    base: Version
    agent: AgentId
    note: Annotated[str, Field(max_length=1000, pattern=r"^[^\x00]*$")] = ""
    tiles: Annotated[list[TileIn], Field(max_length=20_000)] = []
    #: Tiles that are wholly unknown now.
    removed: Annotated[list[TilePlace], Field(max_length=20_000)] = []
    #: All semi-dynamic objects; null leaves those of the base.
    objects: Annotated[list[MapObject], Field(max_length=1000)] | None = None

    @model_validator(mode="after")
    def _unique(self) -> VersionIn:
        places = [(tile.x, tile.y) for tile in self.tiles] + [(tile.x, tile.y) for tile in self.removed]
        if len(set(places)) != len(places):
            raise ValueError("a tile is listed twice")
        tags = [one.tag for one in self.objects or ()]
        if len(set(tags)) != len(tags):
            raise ValueError("an object is listed twice")
        return self


class MapVersion(Model):
    version: Version
    created_at: UtcTime
    agent: AgentId
    note: str = ""
    #: Of all cells that something is known of; null where there are none.
    bounds: CellBounds | None
    #: Tiles that this version changed or removed.
    changed: int


class VersionPage(Model):
    items: list[MapVersion]
    next_cursor: str | None = None


class TileUpload(Model):
    """Tiles sent ahead of the version that will name them by digest."""

    tiles: Annotated[list[TileText], Field(min_length=1, max_length=2000)]


class TilesKept(Model):
    #: In the order of the tiles sent.
    digests: list[Digest]


class Tile(Model):
    """``digest`` and ``data`` are null for a tile that is wholly unknown now; ``data`` also where it was not wanted."""

    x: TileIndex
    y: TileIndex
    digest: Digest | None
    data: TileText | None = None


class TilePage(Model):
    """Tiles that differ between two versions, by place; ask for the next page with the same ``version``."""

    version: Version
    since: Version
    tiles: list[Tile]
    next_cursor: str | None = None


class MapObjects(Model):
    version: Version
    objects: list[MapObject]


class ObjectChange(Model):
    """``before`` is null for an object that is new, ``after`` for one that is gone.

    ``moved_m`` and ``turned_rad`` (0 to pi) tell how far it is from where it was, for one that is in both.
    """

    tag: Tag
    before: MapObject | None
    after: MapObject | None
    moved_m: float | None = None
    turned_rad: float | None = None


class MapDiff(Model):
    """From version ``before`` to version ``after``. A cell is occupied over p = 0.65, free under 0.196.

    Cells that something was known of before became occupied or free; the others became known, whatever they are now.
    """

    before: Version
    after: Version
    tiles: list[TilePlace]
    became_occupied: int
    became_free: int
    became_known: int
    became_unknown: int
    objects: list[ObjectChange]


DoorState = Literal["open", "closed", "unknown"]


class Door(Model):
    """A door as the newest version of a map has it; ``state`` is unknown where no robot could tell."""

    tag: Tag
    #: As the object database has it; null for a door that is not registered.
    name: str | None
    state: DoorState
    #: Turned so far from where it is closed (rad, counter-clockwise), where that is known.
    angle: float | None
    #: When a robot last had it before its sensors; when the version was made, where the robot did not say.
    seen_at: UtcTime
    map: MapId
    version: Version
    #: Its hinge, and where the panel points, in the map frame.
    pose: Pose
    #: The same in the room frame; null where nobody knows where the map lies in the room.
    room_pose: Pose | None


class DoorsAnswer(Model):
    #: By tag.
    doors: list[Door]


#: What a picture shows.
Layer = Literal["occupancy", "mean", "variance", "count"]
PgmMode = Literal["trinary", "raw"]
