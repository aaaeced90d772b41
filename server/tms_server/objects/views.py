"""Between table rows and the wire: what an object has of its own, and what it takes from its product."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from tms_schemas.objects import ObjectFields, Product, ProductIn, Shape, Size, TownObject
from tms_server.db.tables import ObjectRow, ProductRow
from tms_server.db.times import from_us
from tms_server.log.bodies import TrackedObject
from tms_server.objects.search import search_text


class Stored(NamedTuple):
    """An object and its product, if it has one."""

    object: ObjectRow
    product: ProductRow | None


def town_object(stored: Stored) -> TownObject:
    """As answered: where the object has no value of its own, that of its product."""
    row, product = stored
    own = own_fields(row)
    weight_g, weight_sd_g = weight(stored)
    filled = {
        "size_m": own.size_m or size(stored),
        "weight_g": weight_g,
        "weight_sd_g": weight_sd_g,
        "category": category(row.category, product),
        "shape": shape(stored),
    }
    return TownObject(
        tag=row.tag,
        created_at=from_us(row.created_at),
        updated_at=from_us(row.updated_at),
        **(dict(own) | filled),
    )


def own_fields(row: ObjectRow) -> ObjectFields:
    return ObjectFields(
        name=row.name,
        synonyms=json.loads(row.synonyms),
        jan=row.jan,
        size_m=_load(row.size_m),
        weight_g=row.weight_g,
        weight_sd_g=row.weight_sd_g,
        category=row.category,
        room=row.room,
        tracking=row.tracking,
        shape=_shape(row.shape),
        tag_pose=_load(row.tag_pose),
        user_memory=None if row.user_memory is None else row.user_memory.hex(),
    )


def object_columns(fields: ObjectFields, product: ProductRow | None, tag: str) -> dict[str, Any]:
    return {
        "name": fields.name,
        "synonyms": _dump(fields.synonyms),
        "jan": fields.jan,
        "size_m": _dump(fields.size_m),
        "weight_g": fields.weight_g,
        "weight_sd_g": fields.weight_sd_g,
        "category": fields.category,
        "room": fields.room,
        "tracking": fields.tracking,
        "shape": _shape_json(fields.shape),
        "tag_pose": _dump(fields.tag_pose),
        "user_memory": None if fields.user_memory is None else bytes.fromhex(fields.user_memory),
        "search_text": searched(tag, fields.name, fields.synonyms, fields.jan, category(fields.category, product)),
    }


def searched(tag: str, name: str, synonyms: list[str], jan: str | None, category: str | None) -> str:
    return search_text([name, *synonyms, category, tag, jan])


def tracked(stored: Stored) -> tuple[str, TrackedObject] | None:
    """The room that tracks the object and what its belief knows of it; None for what is mapped or in no room."""
    row = stored.object
    if row.room is None or row.tracking != "placement":
        return None
    weight_g, weight_sd_g = weight(stored)
    size_m = size(stored)
    return row.room, TrackedObject(
        tag=row.tag,
        name=row.name,
        weight_g=weight_g,
        weight_sd_g=weight_sd_g or 0.0,
        # What a laser near the floor sees of it, averaged over its two horizontal sides.
        size_m=None if size_m is None else (size_m[0] + size_m[1]) / 2,
    )


def weight(stored: Stored) -> tuple[float | None, float | None]:
    """(grams, standard deviation). The product's spread does not apply to an object that was weighed itself."""
    row, product = stored
    if row.weight_g is not None or product is None:
        return row.weight_g, row.weight_sd_g
    return product.weight_g, product.weight_sd_g if row.weight_sd_g is None else row.weight_sd_g


def size(stored: Stored) -> Size | None:
    row, product = stored
    found = _load(row.size_m) or (_load(product.size_m) if product else None)
    return None if found is None else (found[0], found[1], found[2])


def category(own: str | None, product: ProductRow | None) -> str | None:
    return own if own is not None or product is None else product.category


def shape(stored: Stored) -> Shape | None:
    row, product = stored
    return _shape(row.shape) or (_shape(product.shape) if product else None)


def product_fields(row: ProductRow) -> ProductIn:
    return ProductIn(
        name=row.name,
        size_m=_load(row.size_m),
        weight_g=row.weight_g,
        weight_sd_g=row.weight_sd_g,
        category=row.category,
        shape=_shape(row.shape),
    )


def town_product(row: ProductRow) -> Product:
    return Product(jan=row.jan, **dict(product_fields(row)))


def product_columns(jan: str, fields: ProductIn) -> dict[str, Any]:
    return {
        "name": fields.name,
        "size_m": _dump(fields.size_m),
        "weight_g": fields.weight_g,
        "weight_sd_g": fields.weight_sd_g,
        "category": fields.category,
        "shape": _shape_json(fields.shape),
        "search_text": search_text([fields.name, fields.category, jan]),
    }


def _shape(text: str | None) -> Shape | None:
    return None if text is None else Shape.model_validate_json(text)


def _shape_json(shape: Shape | None) -> str | None:
    return None if shape is None else shape.model_dump_json(by_alias=True)


def _dump(value: Any) -> str | None:
    return None if value is None else json.dumps(value, ensure_ascii=False, separators=(",", ":"))


def _load(text: str | None) -> Any:
    return None if text is None else json.loads(text)
