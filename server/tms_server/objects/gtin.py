"""JAN / EAN / UPC / GTIN: one number, four lengths, one canonical form."""

from __future__ import annotations

import re
from functools import lru_cache

from biip import BiipException
from biip.checksums import gs1_standard_check_digit
from biip.gtin import Gtin
from epcpy.epc_schemes.sgtin import SGTIN
from epcpy.utils.common import ConvertException

_DIGITS = re.compile(r"[0-9]{8}|[0-9]{12,14}")
_SGTIN_96 = re.compile(r"30[0-9A-F]{22}")


class InvalidGtin(ValueError):
    """No GTIN; the message says why."""


@lru_cache(maxsize=4096)
def canonical_gtin(digits: str) -> str:
    """The form under which a product is stored: 13 digits, 8 for a GTIN-8, 14 only where the first is not 0.

    Leading zeros do not count: UPC-A gets one in front, a longer form loses them, as GS1 aligns all forms to the right.

    Raises:
        InvalidGtin: another length, other characters, or a wrong check digit.
    """
    if not _DIGITS.fullmatch(digits):
        raise InvalidGtin(f"{digits!r} has not 8, 12, 13 or 14 digits")
    expected = gs1_standard_check_digit(digits[:-1])
    if int(digits[-1]) != expected:
        raise InvalidGtin(f"{digits}: the check digit is {digits[-1]}, but {expected} belongs there")
    number = digits.lstrip("0")
    if not number:
        raise InvalidGtin(f"{digits} names no product")
    return next(number.zfill(length) for length in (8, 13, 14) if len(number) <= length)


def gtin_of_epc(tag: str) -> str | None:
    """The canonical GTIN inside an SGTIN-96 EPC (24 hex digits, upper case); None for any other tag.

    14 digits where the tag is on a packing of several (indicator 1 to 8) or on goods of variable measure (9). The
    number may be nonsense: the EPCs that laboratories make up decode just as well. See ``names_its_company``.
    """
    try:
        epc = _sgtin(tag)
        return None if epc is None else canonical_gtin(epc.gtin())
    except (ConvertException, InvalidGtin):
        return None


def names_its_company(tag: str) -> bool:
    """Whether an SGTIN-96 EPC has a company prefix that GS1 gave out, in the length it was given out in.

    Of numbers made up at random one in twenty passes. In-store numbers never do.
    """
    try:
        epc = _sgtin(tag)
        if epc is None:
            return False
        gtin = Gtin.parse(epc.gtin().zfill(14))
    except (ConvertException, BiipException):
        return False
    # urn:epc:id:sgtin:<company prefix>.<indicator and item>.<serial>
    company = epc.epc_uri.rpartition(":")[2].partition(".")[0]
    return gtin.company_prefix is not None and gtin.company_prefix.value == company and not in_store(gtin.value)


def in_store(gtin: str) -> bool:
    """A restricted circulation number (02, 04, 20 to 29 ...): each shop or company gives them to its own things."""
    try:
        prefix = Gtin.parse(gtin).prefix
    except BiipException:
        return False
    return prefix is not None and "Restricted Circulation" in prefix.usage


def _sgtin(tag: str) -> SGTIN | None:
    """Raises ``ConvertException`` where the bits are none."""
    return SGTIN.from_hex(tag) if _SGTIN_96.fullmatch(tag) else None
