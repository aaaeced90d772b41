"""Cursors: what goes in comes out, and nothing else is one."""

from __future__ import annotations

import base64

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_server.db.paging import cut, decode_cursor, encode_cursor
from tms_server.errors import Invalid

keys = st.lists(st.text(st.characters(min_codepoint=0x21, max_codepoint=0x7E), min_size=1, max_size=64), min_size=1)


@given(keys)
def test_a_cursor_comes_back_as_its_key(key: list[str]) -> None:
    assert decode_cursor(encode_cursor(*key), len(key)) == tuple(key)


@given(st.text(max_size=50) | st.binary(max_size=50).map(lambda b: base64.urlsafe_b64encode(b).decode()))
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(Invalid):
        decode_cursor(text, 1)


@pytest.mark.parametrize("key", [("a", "b"), ("",), ("a\x00",), ("\ud800",), ("あ",)])
def test_a_key_that_no_list_has_is_refused(key: tuple[str, ...]) -> None:
    with pytest.raises(Invalid):
        decode_cursor(encode_cursor(*key), 1)


@given(st.lists(st.integers(0, 999).map(lambda n: f"{n:03}"), unique=True).map(sorted), st.integers(1, 20))
def test_pages_concatenated_are_the_whole(items: list[str], limit: int) -> None:
    seen: list[str] = []
    cursor: str | None = None
    while True:
        after = decode_cursor(cursor, 1)
        rest = [item for item in items if after is None or item > after[0]]
        page, cursor = cut(rest[: limit + 1], limit, lambda item: (item,))
        seen += page
        assert len(page) <= limit
        if cursor is None:
            break
        assert len(page) == limit
    assert seen == items
