"""Objects (by tag), products (by JAN) and intake."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from tms_schemas.base import Grams, Jan, Model, Name, Polygon, Pose, RoomId, Tag, UtcTime, Xy, numbers

Length = Annotated[float, Field(gt=0, le=100)]


def _cube(value: Any) -> Any:
    return (value, value, value) if isinstance(value, int | float) else value


#: Full extents (x, y, z) in metres; a single number means a cube of that edge.
Size = Annotated[tuple[Length, Length, Length], BeforeValidator(_cube), numbers(3, exclusiveMinimum=0, maximum=100)]
#: The tag's user memory as hex, at most 192 bytes.
UserMemory = Annotated[str, Field(pattern=r"^([0-9A-Fa-f]{2}){0,192}$")]
Tracking = Literal["placement", "map"]


class Shape(Model):
    """What a mapper needs to recognise the thing: footprint and what a laser sees of it, in the object frame."""

    class_: Annotated[str, Field(alias="class", min_length=1, max_length=64)]
    polygon: Polygon
    parts: Annotated[list[Polygon], Field(max_length=100)] = []


class ProductIn(Model):
    name: Name
    size_m: Size | None = None
    weight_g: Grams | None = None
    weight_sd_g: Grams | None = None
    category: Name | None = None
    shape: Shape | None = None


class Product(ProductIn):
    jan: Jan


class ProductPage(Model):
    items: list[Product]
    next_cursor: str | None = None


class ObjectFields(Model):
    """What is known of one thing. Size, weight, category and shape fall back to those of its product."""

    name: Name
    synonyms: Annotated[list[Name], Field(max_length=50)] = []
    jan: Jan | None = None
    size_m: Size | None = None
    weight_g: Grams | None = None
    weight_sd_g: Grams | None = None
    category: Name | None = None
    room: RoomId | None = None
    tracking: Tracking = "placement"
    shape: Shape | None = None
    tag_pose: Pose | None = None
    user_memory: UserMemory | None = None


class ObjectPatch(Model):
    """Fields to change; a field that is absent stays, null clears it."""

    name: Name | None = None
    synonyms: Annotated[list[Name], Field(max_length=50)] | None = None
    jan: Jan | None = None
    size_m: Size | None = None
    weight_g: Grams | None = None
    weight_sd_g: Grams | None = None
    category: Name | None = None
    room: RoomId | None = None
    tracking: Tracking | None = None
    shape: Shape | None = None
    tag_pose: Pose | None = None
    user_memory: UserMemory | None = None


class TownObject(ObjectFields):
    """An object as the server answers it, product values filled in."""

    tag: Tag
    created_at: UtcTime
    updated_at: UtcTime


class ObjectPage(Model):
    items: list[TownObject]
    next_cursor: str | None = None


class ObjectModel(Model):
    """Geometry for mapping: class, polygon and parts of the object's own shape or its product's, and its tag pose."""

    tag: Tag
    class_: str = Field(alias="class")
    polygon: Polygon
    parts: list[Polygon] = []
    tag_pose: Pose | None = None


class IntakeRequest(Model):
    """Register an object in one call: tag and JAN, or an SGTIN-96 EPC alone, or tag and name."""

    tag: Tag
    jan: Jan | None = None
    name: Name | None = None
    room: RoomId | None = None
    synonyms: Annotated[list[Name], Field(max_length=50)] = []


class IntakeResult(Model):
    object: TownObject
    product: Product | None = None
    created: bool


class UnknownTag(Model):
    """A tag that was seen but is not registered."""

    tag: Tag
    room: RoomId
    agent: str
    first_seen: UtcTime
    last_seen: UtcTime
    count: int
    label: str | None = None
    xy: Xy | None = None


class UnknownTagPage(Model):
    items: list[UnknownTag]
    next_cursor: str | None = None


class CatalogueImport(Model):
    """Answer to a catalogue import: rows stored, and the rows refused with line number and reason."""

    stored: int
    refused: list[CatalogueProblem] = []
    #: Columns that a product has no field for.
    ignored_columns: list[str] = []


class CatalogueProblem(Model):
    line: int
    reason: str
