"""SCIP numbers, sums and data lines: the examples of the specification and laws."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.devices.scip.encoding import checksum, cut_blocks, decode, encode, join_blocks

#: Laws hold on a busy computer, too.
DIGITS = st.integers(0x30, 0x6F)


def decoded(text: bytes, width: int) -> list[int]:
    return decode(np.frombuffer(text, np.uint8), width).tolist()


@pytest.mark.parametrize(("text", "value"), [(b"CB", 1234), (b"1Dh", 5432), (b"m2@0", 16_000_000)])
def test_examples_of_the_specification(text, value):
    assert decoded(text, len(text)) == [value]
    assert encode(np.array([value]), len(text)) == text


@pytest.mark.parametrize("line", [b"00P", b"99b", b"02R", b"0Ee", b"03FnG"])
def test_sums_of_the_specification(line):
    assert checksum(line[:-1]) == line[-1]


@given(st.sampled_from([2, 3, 4]), st.data())
def test_what_is_encoded_is_decoded(width, data):
    values = data.draw(st.lists(st.integers(0, (1 << 6 * width) - 1), max_size=50))
    chars = encode(np.array(values, int), width)
    assert len(chars) == width * len(values) and decoded(chars, width) == values


def test_what_is_too_large_is_the_largest():
    assert encode(np.array([5000, -3]), 2) == b"oo00"


@given(st.lists(DIGITS, max_size=300).map(bytes))
def test_lines_of_data_are_joined_again(chars):
    lines = cut_blocks(chars)
    assert all(len(line) <= 65 and checksum(line[:-1]) == line[-1] for line in lines.split(b"\n") if line)
    assert join_blocks(lines).tobytes() == chars


@given(st.lists(DIGITS, min_size=1, max_size=200).map(bytes), st.data())
def test_one_wrong_character_is_always_noticed(chars, data):
    lines = bytearray(cut_blocks(chars))
    at = data.draw(st.integers(0, len(lines) - 1))
    lines[at] = data.draw(DIGITS.filter(lambda new: new != lines[at]))
    with pytest.raises(ValueError, match="data line"):
        join_blocks(bytes(lines))


@given(st.lists(DIGITS, min_size=1, max_size=200).map(bytes), st.data())
def test_a_lost_character_is_noticed_or_a_line_of_another_length(chars, data):
    lines = cut_blocks(chars)
    at = data.draw(st.integers(0, len(lines) - 1))
    with contextlib.suppress(ValueError):
        assert len(join_blocks(lines[:at] + lines[at + 1 :])) < len(chars)


@pytest.mark.parametrize("chars", [b"0/0", b"0p0", b"0\x800", b"00"])
def test_characters_that_encode_nothing(chars):
    with pytest.raises(ValueError, match=r"encodes nothing|whole number"):
        decode(np.frombuffer(chars, np.uint8), 3)
