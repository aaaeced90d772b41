"""ThingMagic frames, replies and sessions: laws of the parser, rounds, refusals, and no statement that is not true."""

from __future__ import annotations

import pytest
from device_conversation import Clock, DisturbedLine, assert_true, converse, rounds
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.devices.tags import RoundEnd, TagRead
from tms_agents.devices.thingmagic import messages as m
from tms_agents.devices.thingmagic.codec import CommandParser, Reply, ReplyParser, crc
from tms_agents.devices.thingmagic.emulator import ThingMagicDevice
from tms_agents.devices.thingmagic.session import ThingMagicSession
from tms_agents.devices.transport import DeviceFault

EPCS = ("30352B2E4401D3000000007B", "E200322FE20DF9311328B7E3", "3074257BF7194E4000001A85", "ABCD", "00" * 30)

replies = st.builds(Reply, st.integers(0, 255), st.binary(max_size=250), st.integers(0, 0xFFFF))


def crc_bit_by_bit(data: bytes) -> int:
    value = 0xFFFF
    for byte in data:
        for bit in range(7, -1, -1):
            top = value >> 15
            value = (value << 1 & 0xFFFF) | (byte >> bit & 1)
            if top:
                value ^= 0x1021
    return value


@given(st.binary(max_size=100))
def test_the_crc_is_the_one_of_the_manual(data):
    assert crc(data) == crc_bit_by_bit(data)


@given(st.lists(replies, max_size=5), st.lists(st.integers(1, 40), max_size=8))
def test_any_chunking_gives_the_same_replies(sent, sizes):
    raw, parser, got = b"".join(reply.encode() for reply in sent), ReplyParser(), []
    for size in sizes:
        got += parser.feed(raw[:size])
        raw = raw[size:]
    got += parser.feed(raw)
    assert got == sent and parser.skipped == 0 and parser.pending == 0


@given(st.lists(st.tuples(st.binary(max_size=20).map(lambda b: b.replace(b"\xff", b"")), replies), max_size=4))
def test_garbage_between_replies_is_skipped(parts):
    parser = ReplyParser()
    assert parser.feed(b"".join(garbage + reply.encode() for garbage, reply in parts)) == [one for _, one in parts]
    assert parser.skipped == sum(len(garbage) for garbage, _ in parts)


@given(st.lists(st.binary(max_size=300), max_size=10))
def test_any_bytes_are_survived(pieces):
    for parser in (ReplyParser(), CommandParser()):
        for piece in pieces:
            for found in parser.feed(piece):
                if isinstance(found, Reply):
                    m.buffered_tags(found)
            assert parser.pending < 260


@given(st.binary(max_size=250))
def test_any_buffer_is_survived(data):
    reads = m.buffered_tags(Reply(m.GET_BUFFER, data))
    assert reads is None or all(read.tag for read in reads)


@given(
    st.lists(
        st.builds(
            TagRead,
            tag=st.binary(min_size=2, max_size=30).filter(lambda raw: len(raw) % 2 == 0).map(lambda b: b.hex().upper()),
            antenna=st.integers(1, 15),
            rssi_dbm=st.integers(-128, 0).map(float),
            count=st.integers(1, 255),
        ),
        max_size=4,
    )
)
def test_what_is_put_into_the_buffer_is_what_comes_out(reads):
    assert m.buffered_tags(Reply(m.GET_BUFFER, m.encode_buffered(reads))) == reads


def test_metadata_that_nobody_asked_for_is_passed_over():
    head = bytes.fromhex("01ff 00 01".replace(" ", ""))
    metadata = bytes.fromhex("02 c4 22 0dfb38 00000001 0123 05 0010beef 00".replace(" ", ""))
    word = bytes.fromhex("3400 8123") + bytes.fromhex(EPCS[0]) + b"\xd1\x00"
    # PC with the XPC bit, then an XPC word that announces a second one
    long = bytes.fromhex("3600 8000 0000") + bytes.fromhex(EPCS[0]) + b"\xd1\x00"
    data = head + metadata + (8 * len(long)).to_bytes(2, "big") + long
    assert m.buffered_tags(Reply(m.GET_BUFFER, data)) == [TagRead(tag=EPCS[0], antenna=2, rssi_dbm=-60.0, count=2)]
    assert m.buffered_tags(Reply(m.GET_BUFFER, data[:-1])) is None
    assert m.buffered_tags(Reply(m.GET_BUFFER, data + word)) is None


@pytest.mark.parametrize(
    ("data", "count"),
    [("00000003", 3), ("0000000003", 3), ("00000000000102", 258), ("0000000000000102", 258), ("000000", None)],
)
def test_every_form_of_the_tag_count(data, count):
    assert m.tag_count(Reply(m.READ_MULTIPLE, bytes.fromhex(data))) == count


def session(clock: Clock, **options) -> ThingMagicSession:
    new = ThingMagicSession(poll_s=0.1, read_ms=50, reply_s=0.2, clock=clock, **options)
    new.opened()
    return new


def full_reader(antennas: int = 3) -> ThingMagicDevice:
    device = ThingMagicDevice(antennas)
    for antenna, tags in TRUTH.items():
        for tag in sorted(tags):
            device.see(tag, antenna, rssi_dbm=-60, count=3)
    return device


TRUTH = {1: {*EPCS, *(f"E2{number:022X}" for number in range(12))}, 2: set(), 3: {EPCS[0]}}


def test_rounds_of_several_antennas_with_more_tags_than_a_frame_holds():
    clock, device = Clock(), full_reader()
    items = converse(session(clock, antennas=(1, 2, 3), power_dbm=10), device, clock, 0.5)
    assert rounds(items)[:6] == [(1, TRUTH[1]), (2, set()), (3, TRUTH[3])] * 2
    assert TagRead(tag=EPCS[0], antenna=3, rssi_dbm=-60.0, count=3) in items
    assert [command.code for command in device.heard[:5]] == [0x04, 0x03, 0x97, 0x93, 0x92]


def test_one_tag_at_a_time():
    clock, device = Clock(), ThingMagicDevice()
    device.see(EPCS[1])
    host = session(clock, mode="single")
    assert converse(host, device, clock, 0.15) == [TagRead(tag=EPCS[1], antenna=1)] * 2
    device.lose(EPCS[1])
    assert converse(host, device, clock, 0.1) == [RoundEnd(1)]


def test_a_firmware_that_runs_already_is_not_booted_twice_and_a_boot_loader_that_stays_is_a_fault():
    clock, device = Clock(), full_reader()
    converse(session(clock), device, clock, 0.2)
    assert rounds(converse(session(clock), device, clock, 0.2))[0] == (1, TRUTH[1])
    device = full_reader()
    device.fail[m.BOOT] = m.INVALID_COMMAND
    with pytest.raises(DeviceFault, match=r"refuses command 97: status 0101 invalid command .is it still in the boot"):
        converse(session(clock), device, clock, 0.5)


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        ({"antennas": (1, 2)}, "command 22 .antenna 2.: status 0503 antenna is not connected"),
        ({"antennas": (4,)}, "command 91 .antenna 4.: status 0507 antenna configuration not possible"),
        ({"power_dbm": 31.5}, "command 92: status 0103 power too high"),
    ],
)
def test_refusals_say_why(options, fault):
    clock, device = Clock(), full_reader()
    device.connected = {1}
    with pytest.raises(DeviceFault, match=fault):
        converse(session(clock, **options), device, clock, 0.5)


def test_weighing_pauses_reading():
    clock, device = Clock(), full_reader()
    host = session(clock)
    converse(host, device, clock, 0.25)
    host.pause()
    converse(host, device, clock, 0.05)
    heard, frames = len(device.heard), host.frames
    assert host.field.is_off and converse(host, device, clock, 1.0) == []
    assert {command.code for command in device.heard[heard:]} == {m.VERSION} and host.frames >= frames + 9
    host.resume()
    assert rounds(converse(host, device, clock, 0.1)) == [(1, TRUTH[1])]


@pytest.mark.parametrize("boots_itself", [False, True])
def test_a_power_cycle_after_any_byte_costs_some_cycles_and_tells_nothing_wrong(boots_itself):
    for cut in range(0, 900, 7):
        clock, device = Clock(), full_reader()
        host = session(clock, antennas=(1, 3))
        device.boots_itself = boots_itself
        device.power_cycle_after = cut
        items = converse(host, device, clock, 1.5, step_s=0.05)
        assert device.power_cycles == 1
        assert_true(items, TRUTH)
        assert len(rounds(items)) >= 10, cut


@settings(max_examples=50)
@given(
    # Once per answer: two flips in one, the second in its checksum, make another frame that is right.
    st.lists(
        st.tuples(st.integers(0, 60), st.integers(0, 300), st.sampled_from(["flip", "drop"]), st.integers(1, 255)),
        max_size=12,
        unique_by=lambda harm: harm[0],
    )
)
def test_a_disturbed_line_tells_nothing_wrong_and_recovers(harm):
    clock, device = Clock(), full_reader()
    host = session(clock, antennas=(1, 2, 3))
    assert_true(converse(host, device, clock, 5.0, step_s=0.05, line=DisturbedLine(harm)), TRUTH)
    assert rounds(converse(host, device, clock, 0.5, step_s=0.05))
