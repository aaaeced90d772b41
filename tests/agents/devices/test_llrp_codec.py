"""LLRP bytes: laws of the parser, and messages of known bytes."""

from __future__ import annotations

import dataclasses
import itertools
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.devices.llrp import messages
from tms_agents.devices.llrp.codec import MAX_MESSAGE, FrameParser, LlrpError, Message, Parameter, decode, encode
from tms_agents.devices.llrp.tables import MESSAGES, TLV, TV, Layout
from tms_agents.devices.tags import TagRead

REAL_REPORT = bytes.fromhex(
    "043d0000002c4095892f00f000228d3005fb63ac1f3841ec880467810001" + "86ce820004ec2ea8354c09880001"
)


def field_values(code: str) -> st.SearchStrategy:
    if code in "BHIQ":
        return st.integers(0, 2 ** {"B": 8, "H": 16, "I": 32, "Q": 64}[code] - 1)
    if code in "bh":
        top = 2 ** {"b": 7, "h": 15}[code]
        return st.integers(-top, top - 1)
    if code == "s":
        return st.text(max_size=8)
    if code in "al":
        return st.lists(st.integers(0, 2**16 - 1), max_size=4).map(tuple)
    if code == "e":
        return st.binary(max_size=4).map(lambda raw: (8 * len(raw), raw))
    if code == "y":
        return st.binary(max_size=8).map(lambda raw: (len(raw), raw))
    if code == "*":
        return st.binary(max_size=6)
    return st.binary(min_size=int(code), max_size=int(code))


def parameters(depth: int = 2) -> st.SearchStrategy:
    layouts = [layout for layout in (TV | TLV).values() if depth or not layout.nested]
    return st.sampled_from(layouts).flatmap(lambda layout: content(layout, depth, Parameter))


def content(layout: Layout, depth: int, kind: type) -> st.SearchStrategy:
    children = st.lists(parameters(depth - 1), max_size=3).map(tuple) if layout.nested else st.just(())
    values = st.fixed_dictionaries({name: field_values(code) for name, code in layout.fields})
    return st.builds(kind, st.just(layout.name), values, children)


MESSAGE = st.builds(
    lambda message, number: dataclasses.replace(message, id=number),
    st.sampled_from(list(MESSAGES.values())).flatmap(lambda layout: content(layout, 2, Message)),
    st.integers(0, 2**32 - 1),
)


def chunked(data: bytes, cuts: list[int]) -> list[bytes]:
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    return [data[a:b] for a, b in itertools.pairwise(edges)]


# not timed: the first example builds the strategies of all parameters, which a busy machine may take long for
@given(MESSAGE)
def test_encode_then_decode_is_the_same(message):
    assert decode(encode(message)) == message


@given(st.lists(MESSAGE, max_size=5), st.lists(st.integers(0, 10_000), max_size=8))
def test_any_chunking_gives_the_same_messages(sent, cuts):
    parser = FrameParser()
    got = [message for piece in chunked(b"".join(map(encode, sent)), cuts) for message in parser.feed(piece)]
    assert got == sent and parser.skipped == 0 and parser.pending == 0


# bytes that cannot start a header: its first three bits are zero
@given(st.lists(st.tuples(st.binary(max_size=20).map(lambda b: bytes(x | 0x20 for x in b)), MESSAGE), max_size=4))
def test_garbage_between_messages_is_skipped(parts):
    parser = FrameParser()
    got = parser.feed(b"".join(garbage + encode(message) for garbage, message in parts))
    assert got == [message for _, message in parts]
    assert parser.skipped == sum(len(garbage) for garbage, _ in parts)


@given(st.lists(st.binary(max_size=200), max_size=20))
def test_any_bytes_are_survived(pieces):
    parser = FrameParser()
    for piece in pieces:
        parser.feed(piece)
        assert parser.pending <= MAX_MESSAGE


@given(MESSAGE, st.data())
def test_a_damaged_message_never_crashes(message, data):
    raw = bytearray(encode(message))
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    for read in FrameParser().feed(bytes(raw)):
        messages.tag_reads(read)
        messages.failure(read)


def test_the_buffer_stays_bounded():
    """A header that claims the longest message, then an endless stream."""
    parser = FrameParser()
    parser.feed(bytes.fromhex("043d") + MAX_MESSAGE.to_bytes(4, "big") + bytes(4))
    for _ in range(5):
        parser.feed(b"\xff" * MAX_MESSAGE)
        assert parser.pending <= MAX_MESSAGE


def test_parameters_nested_without_end_are_refused():
    raw = b""
    for _ in range(100):
        raw = (240).to_bytes(2, "big") + (len(raw) + 4).to_bytes(2, "big") + raw
    with pytest.raises(LlrpError, match="too deep"):
        decode(bytes.fromhex("043d") + (10 + len(raw)).to_bytes(4, "big") + bytes(4) + raw)


def test_a_real_report():
    (read,) = messages.tag_reads(decode(REAL_REPORT))
    assert read == TagRead(
        tag="3005FB63AC1F3841EC880467",
        antenna=1,
        rssi_dbm=-50.0,
        first_seen=datetime(2013, 11, 27, 20, 44, 1, 558537, tzinfo=UTC),
        count=1,
    )
    assert encode(decode(REAL_REPORT)) == REAL_REPORT


@pytest.mark.parametrize(
    ("message", "number", "raw"),
    [
        (messages.set_config(10_000), 3, "040300000014000000030000dc00090100002710"),
        (messages.rospec("DELETE", 0), 4, "04150000000e0000000400000000"),
        (
            messages.add_rospec(),
            5,
            "04140000004b0000000500b1004100000001000000b2001200b300050100b60009000000000000b700180001000000b80009"
            "000000000000ba000700010100ed000d01000100ee00061780",
        ),
        (messages.rospec("ENABLE"), 6, "04180000000e0000000600000001"),
        (messages.rospec("START"), 7, "04160000000e0000000700000001"),
        (Message("KEEPALIVE_ACK"), 8, "04480000000a00000008"),
        (Message("CLOSE_CONNECTION"), 10, "040e0000000a0000000a"),
        (Message("DELETE_ROSPEC_RESPONSE", {}, (messages.success(),)), 4, "041f0000001200000004011f000800000000"),
    ],
)
def test_commands_have_the_bytes_that_an_independent_decoder_accepted(message, number, raw):
    assert encode(dataclasses.replace(message, id=number)).hex() == raw


@given(
    st.lists(
        st.builds(
            TagRead,
            tag=st.binary(min_size=1, max_size=30).map(lambda raw: raw.hex().upper()),
            antenna=st.integers(0, 65535),
            rssi_dbm=st.none() | st.integers(-128, 127).map(float),
            first_seen=st.none()
            | st.datetimes(datetime(1970, 1, 1), datetime(9000, 1, 1)).map(lambda at: at.replace(tzinfo=UTC)),
            count=st.integers(0, 65535),
        ),
        max_size=4,
    )
)
def test_reads_survive_the_report(reads):
    assert messages.tag_reads(decode(encode(messages.report(reads)))) == reads
