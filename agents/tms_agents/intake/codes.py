"""What a scanner, a reader in keyboard mode or a person types: a barcode, a tag, or other text.

Formats: see ``devices.scanner``; GS1 Digital Link; GS1 Tag Data Standard (SGTIN-96).
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from tms_agents.devices.scanner import check_digit, product_code

_DIGITS = re.compile(r"[0-9]{8}|[0-9]{12,14}")
#: GS1 Digital Link, as QR codes on things carry it.
_LINK = re.compile(r"https?://\S+/01/([0-9]{8,14})(?:[/?#]|$)")
_HEX_TAG = re.compile(r"(?:[0-9A-F]{2}){4,32}")
_ANY_TAG = re.compile(r"[A-Z0-9._:-]{1,64}")
_TAG_PREFIX = re.compile(r"tag:\s*", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Barcode:
    """GTIN digits with a right check digit."""

    digits: str


@dataclass(frozen=True, slots=True)
class TagId:
    tag: str


@dataclass(frozen=True, slots=True)
class Text:
    """Neither; perhaps the name of a thing."""

    text: str


@dataclass(frozen=True, slots=True)
class Unusable:
    """Meant as a barcode or a tag, but wrong; ``why`` is for the person who scanned."""

    why: str


def barcode(code: str) -> Barcode | Unusable:
    """What a scanner delivered, with or without its AIM identifier."""
    code = code.strip()
    link = _LINK.match(code)
    digits = product_code(link[1] if link else code)
    if digits is not None:
        return Barcode(digits)
    bare = re.sub(r"^\][A-Za-z][0-9A-Za-z]", "", code)
    if _DIGITS.fullmatch(bare):
        return Unusable(f"{bare} was read wrongly (its check digit does not fit); scan it again.")
    return Unusable(f"{_short(bare)} is no product barcode (JAN, EAN, UPC: 8, 12, 13 or 14 digits); scan another one.")


def typed(line: str) -> Barcode | TagId | Text | Unusable:
    """A line from the keyboard. ``tag:`` in front makes a tag of anything that can be one."""
    line = line.strip()
    if prefix := _TAG_PREFIX.match(line):
        return tag_id(line[prefix.end() :])
    if line.startswith(("]", "(01)", "http://", "https://")) or _DIGITS.fullmatch(line):
        found = barcode(line)
        # Tags of eight or fourteen hex digits may have no letter; typed ones are told apart by the check digit only.
        if isinstance(found, Unusable) and len(line) in (8, 14):
            return Unusable(f"{found.why} If it is a tag, type: tag:{line}")
        return found
    squeezed = re.sub(r"[\s:-]", "", line).upper()
    return TagId(squeezed) if _HEX_TAG.fullmatch(squeezed) else Text(line)


def tag_id(text: str) -> TagId | Unusable:
    """A tag's id as given: hex digits may be grouped by colons, dashes or blanks."""
    tag = text.strip().upper()
    squeezed = re.sub(r"[\s:-]", "", tag)
    if _HEX_TAG.fullmatch(squeezed):
        return TagId(squeezed)
    if _ANY_TAG.fullmatch(tag):
        return TagId(tag)
    return Unusable(f"{_short(text)} is no tag: letters, digits and . _ : - only, at most 64.")


#: Partition -> (bits, digits) of the company prefix and (bits, digits) of indicator and item.
_PARTITIONS = [
    (40, 12, 4, 1),
    (37, 11, 7, 2),
    (34, 10, 10, 3),
    (30, 9, 14, 4),
    (27, 8, 17, 5),
    (24, 7, 20, 6),
    (20, 6, 24, 7),
]


def sgtin_96(tag: str) -> str | None:
    """The GTIN, 13 or 14 digits, inside an SGTIN-96 EPC (24 hex digits); None for any other tag.

    Header 8 bits (30), filter 3, partition 3, company prefix, indicator and item, serial 38.
    """
    if not re.fullmatch(r"30[0-9A-F]{22}", tag):
        return None
    bits = int(tag, 16)
    partition = bits >> 82 & 0x7
    if partition >= len(_PARTITIONS):
        return None
    company_bits, company_digits, item_bits, item_digits = _PARTITIONS[partition]
    company = f"{bits >> (82 - company_bits) & (1 << company_bits) - 1:0{company_digits}d}"
    item = f"{bits >> 38 & (1 << item_bits) - 1:0{item_digits}d}"
    if len(company) > company_digits or len(item) > item_digits:
        return None
    gtin = item[0] + company + item[1:]
    gtin += check_digit(gtin)
    return gtin[1:] if gtin[0] == "0" else gtin


def _short(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")
