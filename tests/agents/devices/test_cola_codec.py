"""CoLa telegrams in both dialects: laws of frames, values and scans; telegrams of known bytes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.devices.cola import messages as m
from tms_agents.devices.cola.framing import MAX_FRAME, MAX_PAYLOAD, FrameParser, Telegram
from tms_agents.devices.cola.scandata import Channel, ScanData, degrees_of_step, sweep, to_values
from tms_agents.devices.cola.values import Reader, Writer

TEXT = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=60)
TELEGRAM = st.builds(lambda text: Telegram(b"s" + text.encode(), "A"), TEXT) | st.builds(
    lambda payload: Telegram(b"s" + payload, "B"), st.binary(max_size=300)
)
NUMBERS = st.one_of(
    st.tuples(st.just("B"), st.integers(0, 255)),
    st.tuples(st.just("h"), st.integers(-(1 << 15), (1 << 15) - 1)),
    st.tuples(st.just("H"), st.integers(0, (1 << 16) - 1)),
    st.tuples(st.just("i"), st.integers(-(1 << 31), (1 << 31) - 1)),
    st.tuples(st.just("I"), st.integers(0, (1 << 32) - 1)),
    st.tuples(st.just("f"), st.floats(width=32, allow_nan=False)),
)
DIALECT = st.sampled_from(["A", "B"])


@pytest.mark.parametrize(
    ("command", "text", "binary"),
    [
        (m.login(0xF4724744), "sMN SetAccessMode 3 F4724744", "734d4e205365744163636573734d6f64652003f4724744"),
        (m.read("SCdevicestate"), "sRN SCdevicestate", "73524e205343646576696365737461746530"[:-2]),
        (m.stream(True), "sEN LMDscandata 1", "73454e204c4d447363616e646174612001"),
        (m.method("Run"), "sMN Run", "734d4e2052756e"),
        (m.content(True), "sWN LMDscandatacfg 1 0 1 1 0 0 0 0 0 0 1 1", None),
        (m.output_range(0.5, -45, 225), "sWN LMPoutputRange 1 1388 FFF92230 225510", None),
        (m.scan_config(50, 0.5, -45, 225), "sMN mLMPsetscancfg 1388 1 1388 FFF92230 225510", None),
    ],
)
def test_commands_are_those_of_the_manual(command, text, binary):
    assert command.ask("A").encode() == b"\x02" + text.encode() + b"\x03"
    if binary is not None:
        payload = bytes.fromhex(binary)
        assert command.ask("B").encode()[:-1] == b"\x02\x02\x02\x02" + len(payload).to_bytes(4, "big") + payload


def test_a_binary_telegram_of_the_manual():
    raw = bytes.fromhex("02 02 02 02 00 00 00 11 73 52 4e 20 53 43 64 65 76 69 63 65 73 74 61 74 65 30")
    assert m.read("SCdevicestate").ask("B").encode() == raw
    assert m.stream(True).ask("B").encode()[-1] == 0x33


@given(st.lists(TELEGRAM, max_size=5), st.integers(1, 50))
def test_telegrams_come_back_however_they_are_cut(telegrams, step):
    raw = b"".join(telegram.encode() for telegram in telegrams)
    parser = FrameParser()
    found = [one for at in range(0, len(raw), step) for one in parser.feed(raw[at : at + step])]
    assert found == telegrams and parser.pending == parser.skipped == 0


@given(TELEGRAM.filter(lambda t: t.dialect == "B"), st.integers(0, 10_000), st.integers(1, 255))
def test_a_changed_byte_of_a_binary_telegram_is_noticed(telegram, at, change):
    raw = bytearray(telegram.encode())
    raw[at % len(raw)] ^= change
    parser = FrameParser()
    assert telegram not in parser.feed(bytes(raw)) + parser.resume()


@given(TELEGRAM, st.integers(0, 400), st.binary(max_size=20))
def test_after_a_telegram_that_was_cut_the_next_ones_are_heard(telegram, cut, garbage):
    whole = [Telegram(b"sRA SCdevicestate \x01", "B"), Telegram(b"sRA Run 1", "A")]
    parser = FrameParser()
    found = parser.feed(telegram.encode()[:cut] + garbage)
    for one in whole:
        found += parser.feed(one.encode())
    found += parser.resume()
    # what was cut and the garbage may together look like one telegram, which swallows what follows it at once
    assert [one for one in found if one in whole][-1:] == whole[-1:] or parser.skipped > 0
    assert parser.feed(whole[0].encode()) == [whole[0]]


def test_a_beginning_within_a_telegram_of_text_is_another_telegram():
    parser = FrameParser()
    assert parser.feed(b"\x02sSN LMDscan\x02sRA Run 1\x03") == [Telegram(b"sRA Run 1", "A")]
    assert parser.skipped == len(b"\x02sSN LMDscan")


@given(st.lists(st.binary(max_size=3000), max_size=5))
def test_memory_is_bounded_by_any_bytes(pieces):
    parser = FrameParser()
    for piece in pieces:
        parser.feed(piece)
        assert parser.pending <= MAX_FRAME


@pytest.mark.parametrize("head", [b"\x02s", b"\x02\x02\x02\x02\x00\x00\xff\xffs", b"\x02\x02\x02\x02\xff\xff\xff\xffs"])
def test_memory_is_bounded_where_a_telegram_does_not_end(head):
    parser = FrameParser()
    parser.feed(head)
    for _ in range(3 * MAX_PAYLOAD // 1000):
        parser.feed(b" " * 1000)
        assert parser.pending <= MAX_FRAME
    parser.resume()
    assert parser.pending == 0


@given(DIALECT, st.lists(NUMBERS, max_size=12), TEXT)
def test_values_come_back(dialect, numbers, text):
    writer = Writer(dialect, "sRA", "name")
    for kind, value in numbers:
        writer.put(kind, value)
    reader = Reader(FrameParser().feed(writer.text(text).telegram().encode())[0])
    assert (reader.verb, reader.name) == ("sRA", "name")
    assert [reader.number(kind) for kind, _ in numbers] == [value for _, value in numbers]
    assert reader.text() == text and reader.rest == b""
    with pytest.raises(ValueError, match="shorter"):
        reader.number("B")


@given(DIALECT, st.sampled_from("BH"), st.data())
def test_arrays_come_back(dialect, kind, data):
    values = np.array(data.draw(st.lists(st.integers(0, 255 if kind == "B" else 65535), max_size=60)), np.uint16)
    telegram = Writer(dialect, "sSN", "x").put("H", len(values)).array(kind, values).put("H", 0xBEEF).telegram()
    reader = Reader(telegram)
    np.testing.assert_array_equal(reader.array(kind, reader.integer("H")), values)
    assert reader.integer("H") == 0xBEEF
    reader = Reader(telegram)
    with pytest.raises(ValueError, match="fewer sent"):
        reader.array(kind, len(values) + 10)


@pytest.mark.parametrize("text", ["1 G 3", "1 12345 3", "1  3", " 1 3", "1 -2 3"])
def test_values_that_are_no_hex_numbers(text):
    with pytest.raises(ValueError, match="no hex numbers"):
        Reader(Telegram(b"sSN x " + text.encode(), "A")).array("H", 3)


def test_numbers_with_a_sign_are_decimal_and_must_fit():
    reader = Reader(Telegram(b"sRA x +10 -1 10 1FFFF", "A"))
    assert [reader.integer("i") for _ in range(3)] == [10, -1, 16]
    with pytest.raises(ValueError, match="1FFFF does not fit into 2 bytes"):
        reader.integer("H")


@pytest.mark.parametrize(
    "telegram", [Telegram(b"sFA 1", "A"), Telegram(b"sFA \x00\x01", "B"), Telegram(b"sFA\x00\x01", "B")]
)
def test_refusals_say_why(telegram):
    assert m.refusal(Reader(telegram)) == "error 1: the login does not allow it"


def test_refusals_without_a_known_reason():
    assert m.refusal(Reader(Telegram(b"sFA 99", "A"))) == "error 153"
    assert m.refusal(Reader(Telegram(b"sFA", "A"))) == "no reason given"


CHANNEL = st.builds(
    lambda name, values, bits, scale, start, step: Channel(
        name,
        (np.array(values, np.uint16) & 0xFF if bits == 8 else np.array(values, np.uint16)),
        scale,
        0.0,
        start,
        step,
        bits,
    ),
    st.sampled_from(["DIST1", "DIST2", "RSSI1", "RSSI2", "VANG1"]),
    st.lists(st.integers(0, 65535), max_size=50),
    st.sampled_from([8, 16]),
    st.sampled_from([0.1, 1.0, 2.0, 10.0]),
    st.sampled_from([-45.0, -5.0, 0.0, 47.5]),
    st.sampled_from([1 / 12, 1 / 6, 0.25, 1 / 3, 0.5, 1.0]),
)


@given(
    DIALECT,
    st.lists(CHANNEL, max_size=4),
    st.lists(st.tuples(st.integers(0, 1 << 31), st.integers(0, 65535)), max_size=2),
    st.integers(-300, 300),
    st.integers(0, (1 << 32) - 1),
)
def test_scans_come_back(dialect, channels, encoders, layer, clock):
    scan = ScanData(
        tuple(channels),
        serial=18480390,
        status=(0, 2),
        telegrams=7,
        scans=65535,
        since_start_us=clock,
        sent_us=clock // 2,
        inputs=(1, 0),
        outputs=(8, 7),
        layer=layer,
        scan_hz=15.0,
        measurement_hz=16200.0,
        encoders=tuple(encoders),
    )
    again = ScanData.of(Reader(FrameParser().feed(scan.telegram(dialect).encode())[0]))
    for field in ("serial", "status", "telegrams", "scans", "since_start_us", "sent_us", "inputs", "outputs", "layer"):
        assert getattr(again, field) == getattr(scan, field), field
    assert (again.scan_hz, again.measurement_hz, again.encoders) == (15.0, 16200.0, tuple(encoders))
    wanted = [c for c in channels if c.bits == 16] + [c for c in channels if c.bits == 8]
    assert [c.name for c in again.channels] == [c.name for c in wanted]
    for found, channel in zip(again.channels, wanted, strict=True):
        np.testing.assert_array_equal(found.values, channel.values)
        assert (found.bits, found.start_deg) == (channel.bits, channel.start_deg)
        assert found.step_deg == pytest.approx(channel.step_deg, abs=1e-12)
        assert found.scale == pytest.approx(channel.scale, rel=1e-6)


@given(DIALECT, st.binary(max_size=120))
def test_any_payload_makes_a_scan_or_a_value_error(dialect, payload):
    try:
        data = ScanData.of(Reader(Telegram(b"sSN LMDscandata " + payload, dialect)))
    except ValueError:
        return
    assert len(data.channels) <= 40


@given(DIALECT, st.integers(0, 400), st.integers(0, 255))
def test_a_damaged_scan_makes_a_scan_or_a_value_error(dialect, at, value):
    whole = ScanData(
        (Channel("DIST1", np.arange(40, dtype=np.uint16)), Channel("RSSI1", np.ones(40, np.uint16), bits=8))
    )
    payload = bytearray(whole.telegram(dialect).payload)
    payload[16 + at % (len(payload) - 16)] = value
    try:
        data = ScanData.of(Reader(Telegram(bytes(payload), dialect)))
    except ValueError:
        return
    assert all(len(channel.ranges()) == len(channel.values) for channel in data.channels)


def test_values_below_sixteen_are_no_distances():
    channel = Channel("DIST1", np.array([0, 1, 2, 3, 15, 16, 40000], np.uint16), 2.0)
    ranges = channel.ranges()
    assert ranges[0] == math.inf and np.isnan(ranges[1:5]).all() and ranges[5:].tolist() == [0.032, 80.0]
    assert to_values(np.array([np.inf, np.nan, 0.001, 70.0, 200.0]), 2.0).tolist() == [0, 1, 16, 35000, 65535]


@pytest.mark.parametrize(
    ("ticks", "degrees"),
    [(3333, 1 / 3), (1667, 1 / 6), (6667, 2 / 3), (833, 1 / 12), (5000, 0.5), (1250, 0.125), (3300, 0.33)],
)
def test_thirds_of_a_degree_are_exact(ticks, degrees):
    assert degrees_of_step(ticks) == pytest.approx(degrees, abs=1e-12)


def test_sweeps():
    view = {"forward_deg": 90.0, "limits_m": (0.05, 25.0), "model": "TiM781"}
    beams = sweep(-45.0, 1 / 3, 811, 15.0, 16200.0, **view)
    assert np.rad2deg(beams.angles[[0, 405, 810]]) == pytest.approx([-135, 0, 135])
    assert beams.period_s == pytest.approx(1 / 15) and beams.time_increment_s == pytest.approx(1 / 16200)
    assert sweep(-45.0, 1 / 3, 811, 15.0, 1_620_000.0, **view).time_increment_s == pytest.approx(1 / 16200)
    assert sweep(-45.0, 1 / 3, 811, 15.0, 0.0, **view).time_increment_s == pytest.approx(1 / 16200)


@pytest.mark.parametrize(
    ("model", "farthest"),
    [
        ("TiM551-2050001 V2", 10),
        ("TiM571", 25),
        ("TiM781S-2174104", 25),
        ("LMS111", 20),
        ("LMS151", 50),
        ("LMS511", 80),
        ("x", 65.535),
    ],
)
def test_reach_of_the_models(model, farthest):
    assert m.limits_m(model)[1] == farthest


def test_what_the_status_says():
    assert m.trouble((0, 0)) == "" and m.trouble((1, 0)) == ""
    assert m.trouble((0, 2)) == "the window is polluted" and not m.is_error((0, 2))
    assert m.trouble((0, 5)) == "an error, the window is polluted" and m.is_error((0, 5))
