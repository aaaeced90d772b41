"""Tag readers that print: lines of every form, RDM6300 frames, byte order, misreads, a pulled cable."""

from __future__ import annotations

import asyncio
import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from link_listening import on_a_line

from tms_agents.devices.tags import TagRead
from tms_agents.devices.text_reader import Rdm6300Parser, TextReaderSession, tag_of_line
from tms_agents.devices.text_reader_emulator import TextReaderDevice
from tms_agents.devices.transport import DeviceState, Link

UID = "E00401004E17F97A"


@pytest.mark.parametrize(
    ("line", "tag"),
    [
        (UID, UID),
        (UID.lower(), UID),
        ("E0:04:01:00:4E:17:F9:7A", UID),
        ("E0 04 01 00 4E 17 F9 7A ", UID),
        (f"UID: {UID}", UID),
        (f"0x{UID}", UID),
        ("04A1B2C3", "04A1B2C3"),
        ("04A1B2C3D4E5F6", "04A1B2C3D4E5F6"),
        ("30352B2E4401D3000000007B", "30352B2E4401D3000000007B"),
        ("E00401004E17F9", "E00401004E17F9"),  # seven bytes are a tag too
        ("E00401004E17F97", None),
        ("E00401004E17F97AFF", None),
        (f"X{UID}", None),
        ("ISO 15693 Inventory request.", None),
        ("", None),
    ],
)
def test_lines(line, tag):
    assert tag_of_line(line) == tag


def test_readers_that_print_backwards():
    assert tag_of_line("7AF9174E000104E0", "reversed") == UID


@given(st.lists(st.binary(min_size=5, max_size=5).map(lambda raw: raw.hex().upper()), max_size=5), st.data())
def test_rdm6300_frames_in_any_pieces_with_garbage_between(tags, data):
    device, parser, got = TextReaderDevice("rdm6300"), Rdm6300Parser(), []
    garbage = st.binary(max_size=10).map(lambda raw: raw.replace(b"\x02", b""))
    raw = b"".join(data.draw(garbage) + device.print(tag) for tag in tags)
    while raw:
        size = data.draw(st.integers(1, 20))
        got += parser.feed(raw[:size])
        raw = raw[size:]
    assert got == tags and parser.pending == 0


def test_a_known_rdm6300_frame():
    # 4B ^ 00 ^ E2 ^ 9E ^ 3B = 0C
    assert Rdm6300Parser().feed(b"\x024B00E29E3B0C\x03") == ["4B00E29E3B"]


@given(st.binary(min_size=5, max_size=5), st.integers(0, 13), st.integers(1, 255))
def test_a_damaged_rdm6300_frame_is_no_other_tag(raw, place, flip):
    frame = bytearray(TextReaderDevice("rdm6300").print(raw.hex()))
    frame[place] ^= flip
    assert Rdm6300Parser().feed(bytes(frame)) in ([], [raw.hex().upper()])  # a digit may only have changed its case


@given(st.lists(st.binary(max_size=300), max_size=10), st.sampled_from(["lines", "rdm6300"]))
def test_any_bytes_are_survived(pieces, form):
    session = TextReaderSession(form=form)
    for piece in pieces:
        assert all(read.tag for read in session.receive(piece))
        assert session.pending <= 200


@pytest.mark.parametrize("form", ["lines", "rdm6300"])
def test_half_a_tag_is_dropped_when_it_goes_no_further(form):
    now, tag = [0.0], "0123456789" if form == "rdm6300" else UID
    session, device = TextReaderSession(form=form, clock=lambda: now[0]), TextReaderDevice(form)
    session.receive(device.print(tag)[:7])
    now[0] = 2.0
    session.tick()
    assert session.receive(device.print(tag)) == [TagRead(tag=tag)]


@pytest.mark.parametrize("form", ["lines", "rdm6300"])
@pytest.mark.parametrize("kind", ["pty", "tcp"])
async def test_a_cable_pulled_in_the_middle_of_a_tag(kind, form):
    device = TextReaderDevice(form)
    device.tags = ["0123456789" if form == "rdm6300" else UID]
    async with on_a_line(kind, device, tick_s=0.02) as (line, opener):
        seen: list[TagRead | DeviceState] = []
        link = Link(opener, lambda: TextReaderSession(form=form), name="reader", tick_s=0.02)
        async with asyncio.timeout(10), contextlib.aclosing(link.listen()) as groups:
            async for group in groups:
                seen += [group] if isinstance(group, DeviceState) else group
                states = [item.state for item in seen if isinstance(item, DeviceState)]
                if states == ["connected"] and isinstance(seen[-1], TagRead):
                    line.inject(device.print(device.tags[0])[:5])
                    line.hang_up()
                elif states[-1] == "faulty" and kind == "pty":
                    line.plug_in()
                elif len(states) == 3 and isinstance(seen[-1], TagRead):
                    break
    assert states == ["connected", "faulty", "connected"]
    assert {item.tag for item in seen if isinstance(item, TagRead)} == set(device.tags)
