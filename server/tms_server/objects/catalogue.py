"""A product catalogue as CSV, as spreadsheets and wholesalers write it: read row by row, no row lost silently."""

from __future__ import annotations

import csv
import io
import json
import re
import unicodedata
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from pydantic import ValidationError

from tms_schemas.objects import ProductIn
from tms_server.errors import Invalid
from tms_server.objects.gtin import InvalidGtin, canonical_gtin
from tms_server.rooms.polygons import require_area

#: Header names (folded) by the column they mean.
_COLUMNS = {
    "jan": ("jan", "jancode", "ean", "gtin", "upc", "barcode", "janコード", "バーコード"),
    "name": ("name", "product", "productname", "商品名", "品名", "名称"),
    "size": ("size", "sizem", "サイズ", "寸法"),
    "weight": ("weight", "weightg", "重量", "重さ", "重量g"),
    "weight_sd": ("weightsdg", "weightsd"),
    "class": ("class", "category", "分類", "カテゴリ", "カテゴリー"),
    "shape": ("shape", "polygon", "形状"),
}
_MEANING = {name: column for column, names in _COLUMNS.items() for name in names}
_METRES = {"": 1.0, "m": 1.0, "cm": 0.01, "mm": 0.001}
_GRAMS = {"": 1.0, "g": 1.0, "kg": 1000.0}
_QUANTITY = re.compile(r"([0-9]+(?:\.[0-9]*)?|\.[0-9]+)\s*([a-z]*)")


class Row(NamedTuple):
    """A readable row: only the fields whose cells are filled, so that the others keep what is stored."""

    line: int
    jan: str
    fields: dict[str, Any]


class Refused(NamedTuple):
    line: int
    reason: str


class Catalogue(NamedTuple):
    rows: Iterator[Row | Refused]
    ignored_columns: list[str]


def read_catalogue(body: bytes) -> Catalogue:
    """Rows of a CSV file with a header. UTF-8 (with or without byte order mark) or Shift_JIS (cp932).

    Raises:
        Invalid: another encoding, or no header with the columns jan and name.
    """
    lines = csv.reader(io.StringIO(_decoded(body), newline=""), strict=True)
    try:
        header = next(lines, [])
    except csv.Error as error:
        raise Invalid(f"line 1: {error}") from error
    columns = [_MEANING.get(_folded(cell)) for cell in header]
    for needed in ("jan", "name"):
        if columns.count(needed) != 1:
            raise Invalid(f"the first line must name the columns, with one column {needed!r}; it has: {header!r:.200}")
    ignored = [cell for cell, column in zip(header, columns, strict=True) if column is None and cell.strip()]
    return Catalogue(_rows(lines, columns), ignored[:100])


def merged(row: Row, known: ProductIn | None) -> ProductIn:
    """The product with the row's cells filled in. Raises ``ValueError`` saying what is wrong with them."""
    fields = dict(row.fields)
    polygon = fields.pop("polygon", None)
    if polygon is not None:
        category = fields.get("category") or (known.category if known else None)
        if category is None:
            raise ValueError("a shape needs a class")
        shape = polygon if isinstance(polygon, dict) else {"polygon": polygon}
        fields["shape"] = {"class": category} | shape
    try:
        product = ProductIn.model_validate((dict(known) if known else {}) | fields)
        if product.shape is not None:
            require_area([("shape", product.shape.polygon), *(("shape", part) for part in product.shape.parts)])
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ValueError(f"{'/'.join(map(str, first['loc']))}: {first['msg']}") from error
    except Invalid as error:
        raise ValueError(error.detail) from error
    return product


def _rows(lines: Any, columns: list[str | None]) -> Iterator[Row | Refused]:
    while True:
        line = lines.line_num + 1
        try:
            cells = next(lines, None)
        except csv.Error as error:
            yield Refused(line, f"unreadable from here to line {lines.line_num}: {error}")
            continue
        if cells is None:
            return
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) > len(columns) and any(cell.strip() for cell in cells[len(columns) :]):
            yield Refused(line, f"{len(cells)} cells, but the header has {len(columns)}")
            continue
        filled = {column: cell.strip() for column, cell in zip(columns, cells, strict=False) if column and cell.strip()}
        try:
            yield Row(line, _jan(filled), _fields(filled))
        except ValueError as error:
            yield Refused(line, str(error))


def _jan(cells: Mapping[str, str]) -> str:
    digits = re.sub(r"[\s-]", "", unicodedata.normalize("NFKC", cells.get("jan", "")))
    try:
        return canonical_gtin(digits)
    except InvalidGtin as error:
        raise ValueError(f"jan: {error}") from error


def _fields(cells: Mapping[str, str]) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    if "name" in cells:
        fields["name"] = cells["name"]
    if "class" in cells:
        fields["category"] = cells["class"]
    if "size" in cells:
        sides = re.split(r"[x×*✕]", unicodedata.normalize("NFKC", cells["size"]).casefold())
        fields["size_m"] = _size(sides, cells["size"])
    for column, field in (("weight", "weight_g"), ("weight_sd", "weight_sd_g")):
        if column in cells:
            text = unicodedata.normalize("NFKC", cells[column]).casefold()
            fields[field] = _quantity(text, _GRAMS, f"{column}: {cells[column]!r} is no weight in grams")
    if "shape" in cells:
        try:
            fields["polygon"] = json.loads(cells["shape"])
        except (ValueError, RecursionError) as error:
            raise ValueError(f"shape: not JSON ({error})") from error
    return fields


def _size(sides: list[str], text: str) -> Any:
    why = f"size: {text!r} is not x, y and z in metres, as 0.06x0.06x0.2"
    # A unit behind the last side is that of all: 60x60x200mm.
    unit = "".join(re.findall(r"[a-z]+\s*$", sides[-1])).strip()
    lengths = [_quantity(side if side.strip()[-1:].isalpha() else side + unit, _METRES, why) for side in sides]
    if len(lengths) == 1:
        return lengths[0]
    if len(lengths) != 3:
        raise ValueError(why)
    return lengths


def _quantity(text: str, units: Mapping[str, float], why: str) -> float:
    match = _QUANTITY.fullmatch(text.strip())
    if match is None or match[2] not in units:
        raise ValueError(why)
    # Rounded, so that 60 mm is 0.06 m and not its neighbour.
    return round(float(match[1]) * units[match[2]], 12)


def _decoded(body: bytes) -> str:
    for encoding in ("utf-8-sig", "cp932"):
        try:
            return body.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise Invalid("the file is neither UTF-8 nor Shift_JIS text")


def _folded(cell: str) -> str:
    return re.sub(r"[\s_()\[\].-]", "", unicodedata.normalize("NFKC", cell).casefold())
