"""TR3 frames: laws of the parser, and frames of known bytes."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.devices.tr3.codec import (
    MAX_FRAME,
    UID,
    Frame,
    FrameParser,
    command_mode,
    inventory,
    rf_power,
    select_antenna,
)

FRAME = st.builds(Frame, st.integers(0, 255), st.binary(max_size=255), st.integers(0, 255))


@given(st.lists(FRAME, max_size=6), st.lists(st.integers(0, 2000), max_size=8))
def test_any_chunking_gives_the_same_frames(sent, cuts):
    data = b"".join(frame.encode() for frame in sent)
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    parser = FrameParser()
    got = [frame for a, b in itertools.pairwise(edges) for frame in parser.feed(data[a:b])]
    assert got == sent and parser.skipped == 0 and parser.pending == 0


@given(st.lists(st.tuples(st.binary(max_size=30).map(lambda raw: raw.replace(b"\x02", b"\x03")), FRAME), max_size=5))
def test_garbage_between_frames_is_skipped(parts):
    parser = FrameParser()
    got = parser.feed(b"".join(garbage + frame.encode() for garbage, frame in parts))
    assert got == [frame for _, frame in parts]
    assert parser.skipped == sum(len(garbage) for garbage, _ in parts)


@given(st.binary(max_size=300), FRAME)
def test_whatever_came_before_a_frame_is_found_when_the_line_falls_idle(garbage, frame):
    parser = FrameParser()
    found = parser.feed(garbage + frame.encode()) + parser.expire()
    assert parser.pending == 0
    # garbage may by chance be a frame that swallows the beginning of ours; without 03..0D in it, it cannot
    assert frame in found or b"\x02" in garbage


@given(st.lists(st.binary(max_size=600), max_size=10))
def test_any_bytes_are_survived_in_bounded_memory(pieces):
    parser = FrameParser()
    for piece in pieces:
        parser.feed(piece)
        assert parser.pending < MAX_FRAME


def test_a_cut_frame_does_not_hide_the_next_one():
    whole = Frame(UID, bytes(range(9))).encode()
    parser = FrameParser()
    assert parser.feed(whole[:7] + whole) == []  # the cut one still claims the bytes of the next
    assert parser.expire() == [Frame(UID, bytes(range(9)))]


@pytest.mark.parametrize(
    ("frame", "raw"),
    [
        (command_mode(), "02004E040000001C03730D"),
        (select_antenna(0), "02004E029C0003F10D"),
        (select_antenna(1), "02004E029C0103F20D"),
        (rf_power(True), "02004E029E0103F40D"),
        (rf_power(False), "02004E029E0003F30D"),
        (inventory(), "02007803F0000103710D"),
    ],
)
def test_commands_have_the_published_bytes(frame, raw):
    assert frame.encode().hex().upper() == raw


def test_uids_are_printed_most_significant_byte_first():
    (uid,) = FrameParser().feed(bytes.fromhex("0200490900" + "7AF9174E000104E0" + "03140D"))
    assert uid.uid() == "E00401004E17F97A"
    (loop,) = FrameParser().feed(bytes.fromhex("02004C18C8FF4787500104E01A20F26106B1BAAE000000000000000003DF0D"))
    assert loop.uid() == "E00401508747FFC8"
    assert Frame(UID, b"short").uid() is None
