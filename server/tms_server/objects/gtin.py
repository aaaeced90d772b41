"""JAN / EAN / UPC / GTIN: one number, four lengths, one canonical form."""

from __future__ import annotations

import re
from functools import lru_cache

from biip.checksums import gs1_standard_check_digit
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
    """The canonical GTIN inside an SGTIN-96 EPC (24 hex digits, upper case); None for any other tag."""
    if not _SGTIN_96.fullmatch(tag):
        return None
    try:
        return canonical_gtin(SGTIN.from_hex(tag).gtin())
    except (ConvertException, InvalidGtin):
        return None
