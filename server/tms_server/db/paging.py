"""Keyset paging: a cursor holds the key of the last item of a page, so neither COUNT nor OFFSET is needed."""

from __future__ import annotations

import base64
import binascii
import json
import re
from collections.abc import Callable, Sequence
from typing import Annotated, TypeVar

from fastapi import Query

from tms_schemas.problem import ProblemItem
from tms_server.errors import Invalid

Limit = Annotated[int, Query(ge=1, le=1000, description="items per page")]
Cursor = Annotated[str | None, Query(max_length=1000, description="`next_cursor` of the page before")]

_KEY = re.compile(r"[\x21-\x7e]{1,200}")
T = TypeVar("T")


def encode_cursor(*key: str) -> str:
    return base64.urlsafe_b64encode(json.dumps(key, separators=(",", ":")).encode()).rstrip(b"=").decode()


def decode_cursor(cursor: str | None, length: int) -> tuple[str, ...] | None:
    """The key of ``length`` parts that ``encode_cursor`` was given; None for the first page.

    Raises:
        Invalid: no server gave out such a cursor.
    """
    if cursor is None:
        return None
    try:
        data = base64.b64decode(cursor.encode() + b"=" * (-len(cursor) % 4), altchars=b"-_", validate=True)
        key = json.loads(data)
    except (binascii.Error, ValueError, RecursionError):
        key = None
    if (
        not isinstance(key, list)
        or len(key) != length
        or not all(isinstance(part, str) and _KEY.fullmatch(part) for part in key)
    ):
        raise Invalid("this is no cursor", items=[ProblemItem(where="cursor", why="not given out by this list")])
    return tuple(key)


def cut(rows: Sequence[T], limit: int, key: Callable[[T], tuple[str, ...]]) -> tuple[Sequence[T], str | None]:
    """The page out of up to ``limit + 1`` rows, and the cursor of the next page where a row is left over."""
    if len(rows) <= limit:
        return rows, None
    return rows[:limit], encode_cursor(*key(rows[limit - 1]))
