"""Replies of SCIP sensors: laws of the parser, real and odd replies, requests, ranges."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.devices.scip import MODELS, Measure, Parameters, Reply, ReplyParser, measurement, ranges, read_capture
from tms_agents.devices.scip import coding as coding_of
from tms_agents.devices.scip.clock import DeviceClock
from tms_agents.devices.scip.frames import MAX_REPLY
from tms_agents.devices.scip.measurements import STAMP_TURN_MS
from tms_agents.devices.scip.parameters import first_beam_s, motor_speed, sweep
from tms_agents.devices.scip.ranges import raw_ranges
from tms_agents.devices.scip.requests import OldMeasure
from tms_agents.devices.scip.status import meaning
from tms_agents.devices.scip.wording import data, fields, nearest, reply, stamp

#: Laws hold on a busy computer, too.
TEXT = st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters=";"), max_size=16)
REQUEST = st.builds(
    lambda code, start, steps, cluster, skip, count, text: Measure(
        code, start, start + steps, cluster, *((skip, count) if code[0] == "M" else (0, 0)), text
    ),
    st.sampled_from(["GD", "GS", "GE", "MD", "MS", "ME"]),
    st.integers(0, 500),
    st.integers(0, 45),
    st.integers(1, 99),
    st.integers(0, 9),
    st.integers(0, 99),
    TEXT,
)


@st.composite
def measured(draw) -> tuple[bytes, Measure, int, list[int], list[int] | None]:
    """A reply with a measurement, and what is in it."""
    request = draw(REQUEST)
    values = st.lists(st.integers(0, (1 << 6 * request.width) - 1), min_size=request.beams, max_size=request.beams)
    raw, light = draw(values), draw(values) if request.code[1] == "E" else None
    when = draw(st.integers(0, STAMP_TURN_MS - 1))
    body = data(np.array(raw), None if light is None else np.array(light), request.width)
    return reply(request.encode(), "99", stamp(when) + body), request, when, raw, light


TEXT_REPLY = st.builds(
    lambda command, status, lines: reply(command, status, fields(lines)),
    st.sampled_from(["VV", "PP", "II", "QT", "BM", "TM0", "%ST", "SCIP2.0", "SS115200", "QT;hello"]),
    st.sampled_from(["00", "02", "0E", "0F"]),
    st.lists(st.text(st.characters(min_codepoint=48, max_codepoint=126), min_size=1, max_size=30), max_size=5),
)
FRAME = st.one_of(measured().map(lambda found: found[0]), TEXT_REPLY)
NOISE = st.binary(max_size=60).map(lambda raw: raw.replace(b"\n", b"\r"))


@given(measured())
def test_what_is_measured_comes_out(found):
    raw, request, when, distances, light = found
    (out,) = read_capture(raw)
    assert (out.request, out.stamp_ms, out.distances.tolist()) == (request, when, distances)
    assert (None if out.intensities is None else out.intensities.tolist()) == light


@given(REQUEST)
def test_requests_are_understood(request_):
    assert Measure.parse(request_.encode()) == request_


def test_a_cluster_of_none_is_one_step_and_other_commands_are_no_requests():
    assert Measure.parse("MD0000108000000") == Measure("MD", 0, 1080)
    assert [Measure.parse(text) for text in ("QT", "MD00001080000", "GD000010800", "MDaaaabbbb01000", "")] == [None] * 5
    assert OldMeasure.parse("G04472501") == OldMeasure(44, 725) and OldMeasure(44, 725).encode() == "G04472501"


@given(st.lists(FRAME, max_size=5), st.lists(st.integers(0, 5000), max_size=8))
def test_any_chunking_gives_the_same_replies(frames, cuts):
    raw = b"".join(frames)
    edges = [0, *sorted(cut % (len(raw) + 1) for cut in cuts), len(raw)]
    parser, whole = ReplyParser(), ReplyParser()
    assert [one for a, b in itertools.pairwise(edges) for one in parser.feed(raw[a:b])] == whole.feed(raw)
    assert len(whole.feed(b"")) == 0 and whole.skipped == 0 and parser.pending == 0


@given(st.lists(st.tuples(NOISE, FRAME), min_size=1, max_size=4))
def test_noise_that_ends_is_skipped(parts):
    """Noise on a line of its own, as after a burst: the replies behind it are all there."""
    got = ReplyParser().feed(b"".join(noise + b"\n\n" + frame for noise, frame in parts))
    assert [one for one in got if one.status != ""][-len(parts) :] == [
        one for _, frame in parts for one in ReplyParser().feed(frame)
    ]


@given(measured(), measured(), st.data())
def test_a_scan_that_lost_its_end_does_not_take_the_next_with_it(first, second, data_):
    cut = data_.draw(st.integers(0, len(first[0]) - 3))
    # whose command may be taken for the text of the one that was cut
    (got,) = read_capture(first[0][:cut] + second[0])
    assert got.distances.tolist() == second[3]


@given(measured(), st.data())
def test_damage_in_a_scan_is_never_delivered(found, data_):
    """One wrong or one lost byte: nothing comes out, or (noise in the command alone) the same distances."""
    raw, _, _, distances, _ = found
    at = data_.draw(st.integers(0, len(raw) - 1))
    new = data_.draw(st.integers(0x2F, 0x6F).filter(lambda byte: byte != raw[at]).map(lambda byte: bytes([byte])))
    for damaged in (raw[:at] + new + raw[at + 1 :], raw[:at] + raw[at + 1 :]):
        assert all(one.distances.tolist() == distances for one in read_capture(damaged))


@given(st.lists(st.one_of(st.binary(max_size=300), FRAME), max_size=8))
def test_any_bytes_are_survived_in_bounded_memory(pieces):
    parser = ReplyParser()
    for piece in pieces:
        for one in parser.feed(piece):
            measurement(one)
        assert parser.pending <= MAX_REPLY


def test_a_line_that_never_ends_is_dropped():
    parser = ReplyParser()
    for _ in range(100):
        parser.feed(b"0" * 5000)
        assert parser.pending <= MAX_REPLY
    assert parser.skipped > 400_000
    assert parser.feed(b"\n\n" + reply("QT", "00")) == [Reply("QT", "00")]


def test_text_with_a_wrong_sum_is_left_out():
    right = fields(["VEND:Hokuyo Automatic Co.,Ltd.", "PROT:SCIP 2.0"])
    (got,) = ReplyParser().feed(reply("VV", "00", right + b"SERI:H0614967;~\nstray line\n"))
    assert got.lines == (b"VEND:Hokuyo Automatic Co.,Ltd.", b"PROT:SCIP 2.0")


def test_all_ways_to_sum_a_text():
    plain, remark = "SCSP:Initial(600[rpm])", "<-Default setting by user"
    body = fields([plain + remark]) + fields([plain + remark], remarks_unsummed=True)
    with_semicolon = (sum(b"PROT:SCIP 2.0;") & 0x3F) + 0x30
    (got,) = ReplyParser().feed(reply("II", "00", body + b"PROT:SCIP 2.0;" + bytes([with_semicolon, 10])))
    assert got.lines == ((plain + remark).encode(),) * 2 + (b"PROT:SCIP 2.0",)


def test_scip_1_1_has_neither_sums_nor_stamps():
    raw = b"QT\nE\n\nSCIP2.0\n0\n\nV\n0\nVEND:Hokuyo\nFIRM:2.1\n\nG04404701\n0\n0D0E0F0G\n\nG04404701\n0\n0D0E0\n\n"
    got = ReplyParser().feed(raw)
    assert [(one.command, one.status) for one in got] == [("QT", "E"), ("SCIP2.0", "0"), ("V", "0"), ("G04404701", "0")]
    found = measurement(got[-1])
    assert found is not None and found.stamp_ms is None and found.distances.tolist() == [20, 21, 22, 23]


def test_a_reply_of_the_other_version_has_no_measurement():
    (got,) = ReplyParser().feed(b"MS0044004701000\nE\n0000\n000\n\n")
    assert got.status == "E" and measurement(got) is None


def test_a_status_is_of_letters_and_digits():
    for status in ("\u00b99", "  ", "\x00\x00", "+1"):
        parser = ReplyParser()
        assert parser.feed(reply("QT", status)) == [] and parser.skipped


def test_parameters_and_their_faults():
    good = [line.encode() for line in MODELS["UTM-30LX-EW"].parameters.lines()]
    assert Parameters.parse(good) == MODELS["UTM-30LX-EW"].parameters
    for wrong, why in [
        (good[:-1], "SCAN is missing"),
        ([*good[:-1], b"SCAN:0"], "impossible"),
        ([*good, b"AMIN:2000"], "impossible"),
        ([*good, b"DMAX:6e4"], "DMAX is '6e4'"),
        ([*good, b"AMAX:99999"], "impossible"),
    ]:
        with pytest.raises(ValueError, match=why):
            Parameters.parse(wrong)


def test_a_sweep_looks_where_the_sensor_looks():
    p = MODELS["UTM-30LX"].parameters
    whole = sweep(p, Measure("MD", 0, 1080))
    assert len(whole.angles) == 1081 and whole.angles[540] == 0
    assert whole.angles[-1] == pytest.approx(math.radians(135)) and whole.angles[0] == pytest.approx(-math.radians(135))
    assert (whole.period_s, whole.range_min_m, whole.range_max_m) == (0.025, 0.023, 60.0)
    assert whole.time_increment_s == pytest.approx(0.025 / 1440)
    four = sweep(p, Measure("MS", 0, 1080, 4), speed=2000, skip=2)
    assert len(four.angles) == 271 and four.range_max_m == 4.094
    assert four.angles[0] == pytest.approx(whole.angles[:4].mean()) and four.angles[-1] == whole.angles[1080]
    assert four.period_s == pytest.approx(0.09) and four.time_increment_s == pytest.approx(0.03 / 1440 * 4)
    assert first_beam_s(p, Measure("MD", 720, 1000)) == pytest.approx(0.0125)


@pytest.mark.parametrize(
    ("text", "speed"),
    [
        ("Initial(600[rpm])<-Default setting by user", 600),
        ("Level 05(570[rpm])", 570),
        ("600", 600),
        ("Level 05", None),
        ("600000", None),
        ("12", None),
        ("", None),
    ],
)
def test_the_speed_of_the_motor(text, speed):
    assert motor_speed({"SCSP": text}, 600) == speed


@pytest.mark.parametrize(
    ("model", "raw", "metres"),
    [
        ("URG-04LX", [0, 1, 6, 19, 20, 5600, 5601], [math.inf, math.nan, math.nan, math.nan, 0.02, 5.6, math.inf]),
        ("UTM-30LX", [0, 1, 2, 3, 4, 5, 22, 23], [math.nan, math.inf, *[math.nan] * 5, 0.023]),
        ("UST-20LX", [0, 1, 19, 20, 60000, 65533], [math.nan] * 3 + [0.02, 60.0, math.inf]),
        ("of next year", [0, 1, 20, 30000, 30001], [math.nan] * 2 + [0.02, 30.0, math.inf]),
    ],
)
def test_codes_are_no_distances(model, raw, metres):
    p = MODELS[model].parameters if model in MODELS else Parameters(model, 20, 30000, 1440, 0, 1080, 540, 2400)
    body = stamp(0) + data(np.array(raw), None, 3)
    (found,) = read_capture(reply(Measure("GD", 0, len(raw) - 1).encode(), "00", body))
    np.testing.assert_allclose(ranges(found, p), metres)


def test_the_largest_short_range_is_no_range():
    body = stamp(0) + data(np.array([4094, 4095]), None, 2)
    (found,) = read_capture(reply(Measure("GS", 0, 1).encode(), "00", body))
    np.testing.assert_allclose(ranges(found, MODELS["URG-04LX"].parameters), [4.094, math.inf])


@given(st.sampled_from(sorted(MODELS)), st.lists(st.integers(25, 5600), min_size=1, max_size=50))
def test_ranges_survive_the_sensor(model, millimetres):
    p = MODELS[model].parameters
    metres = np.array([*millimetres, math.inf, math.nan]) / 1000
    body = stamp(0) + data(raw_ranges(metres, p), None, 3)
    (found,) = read_capture(reply(Measure("GD", 0, len(metres) - 1).encode(), "00", body))
    np.testing.assert_allclose(ranges(found, p), metres, rtol=0, atol=1e-9)


def test_only_models_that_have_it_are_asked_for_intensity():
    has = {name: coding_of(model.parameters.modl).intensity for name, model in MODELS.items()}
    assert [name for name, yes in has.items() if not yes] == ["URG-04LX", "URG-04LX-UG01"]
    assert not coding_of("a sensor of next year").intensity


@given(st.integers(1, 30), st.lists(st.integers(0, 100), min_size=1, max_size=60))
def test_the_nearest_of_a_cluster(cluster, values):
    raw = np.array(values, np.int32)
    picked = raw[nearest(raw, raw >= 20, cluster)]
    groups = [values[at : at + cluster] for at in range(0, len(values), cluster)]
    assert picked.tolist() == [min([v for v in group if v >= 20], default=group[0]) for group in groups]


@given(
    st.integers(0, STAMP_TURN_MS - 1),
    st.lists(st.integers(0, 3 * STAMP_TURN_MS), min_size=1, max_size=20),
    st.integers(-5000, 5000),
)
def test_the_clock_is_unwrapped_over_any_pause(first, steps, drift_ms):
    clock, true_ms = DeviceClock(), first
    assert clock.unwrap(first, 50.0) == first / 1000
    for number, step in enumerate(steps):
        true_ms += step
        host_s = 50.0 + (true_ms - first + drift_ms * (number % 2)) / 1000
        assert clock.unwrap(true_ms % STAMP_TURN_MS, host_s) == pytest.approx(true_ms / 1000)


def test_a_clock_that_was_set_anew_goes_on():
    clock = DeviceClock()
    clock.unwrap(5_000_000, 10.0)
    assert clock.unwrap(250, 13.0) == pytest.approx(5003.0)
    assert clock.unwrap(275, 13.025) == pytest.approx(5003.025)


def test_codes_in_words():
    assert meaning("MD", "04") == "status 04 last step is out of range"
    assert meaning("BM", "01") == "status 01 the laser does not work"
    assert meaning("ME", "51") == "status 51 hardware fault"
    assert meaning("QT", "zz") == "status zz"
