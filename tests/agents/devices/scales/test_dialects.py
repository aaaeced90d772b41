"""What lines of scales mean: the formats of manuals and firmware, and lines that are none."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.devices.lines import LineParser
from tms_agents.devices.scales import DIALECTS, parse_line
from tms_agents.devices.scales.dialects import Answer, Reading
from tms_agents.devices.scales.parity import add_even_parity, strip_even_parity


@pytest.mark.parametrize(
    ("dialect", "line", "grams", "stable", "fault"),
    [
        # firmware 1.2: time, weight, unit, raw, two temperatures, each but the weight optional
        ("openscale", "12034,0.412,kg,25.81,0,", 412.0, None, ""),
        ("openscale", "12034,1.00,lbs,8355808,25.81,24.50,", 453.59237, None, ""),
        ("openscale", "0.41,kg,", 410.0, None, ""),
        ("openscale", "-3,kg,25.8,", -3000.0, None, ""),
        ("openscale", "12034,-0.005,kg,", -5.0, None, ""),
        # firmware 1.0: time, two temperatures, weight, unit
        ("openscale", "12034,25.81,0,0.412,kg", 412.0, None, ""),
        ("openscale", "0.412,kg", 412.0, None, ""),
        ("openscale", "12034,nan,kg,25.81,0,", math.nan, None, "no reading"),
        ("openscale", "12034,ovf,kg,", math.nan, None, "overload"),
        # EK-L, page 28; GC, page 51; HC-i, page 48; FX-i
        ("and", "ST,+001234.5  g", 1234.5, True, ""),
        ("and", "US,-0000012.3   g", -12.3, False, ""),
        ("and", "ST,+0001.234 kg", 1234.0, True, ""),
        ("and", "ST,OK,+0001.234 kg", 1234.0, True, ""),
        ("and", "ST,GS,+000010.5g", 10.5, True, ""),
        ("and", "ST, -002.7255 lb", -2.7255 * 453.59237, True, ""),
        ("and", "ST,+00000.50 oz", 0.5 * 28.349523125, True, ""),
        ("and", "ST,+00012.500 mg", 0.0125, True, ""),
        ("and", "OL,+9999999E+19", math.nan, False, "overload"),
        ("and", "OL,-9999.999 lb", math.nan, False, "overload"),
        ("and", "QT,+00012345 PC", math.nan, True, "the scale counts pieces"),
        ("and", "ST,+000123.4  %", math.nan, True, "the scale shows %, which is no unit of mass"),
        ("and", "\x06ST,+001234.5  g", 1234.5, True, ""),
        # JS, page 30; AL-IC, page 72
        ("mt-sics", "S S     100.00 g", 100.0, True, ""),
        ("mt-sics", "S D      -1.23 kg", -1230.0, False, ""),
        ("mt-sics", "S S 12 oz", 12 * 28.349523125, True, ""),
        ("mt-sics", "S +", math.nan, False, "overload"),
        ("mt-sics", "S -", math.nan, False, "underload"),
        ("mt-sics", "S I", math.nan, None, "busy"),
        ("mt-sics", "S S Error 10b", math.nan, True, "error 10b"),
    ],
)
def test_weights(dialect, line, grams, stable, fault):
    said = parse_line(DIALECTS[dialect], line.encode())
    assert isinstance(said, Reading)
    assert said.sample.values == pytest.approx((grams,), nan_ok=True)
    assert (said.sample.stable, said.sample.fault) == (stable, fault)


@pytest.mark.parametrize(
    ("dialect", "line", "refusal"),
    [
        ("and", "EC,E01", "undefined command (EC,E01)"),
        ("and", "EC,E2", "not ready (EC,E2)"),
        ("and", "EC,E11", "not stable (EC,E11)"),
        ("and", "EC,E99", "error (EC,E99)"),
        ("and", "\x06", ""),
        ("mt-sics", "ES", "syntax error (ES)"),
        ("mt-sics", "ET", "transmission error (ET)"),
        ("mt-sics", "EL", "logical error (EL)"),
        ("mt-sics", "Z A", ""),
        ("mt-sics", "ZI S", ""),
        ("mt-sics", "T S     100.00 g", ""),
        ("mt-sics", "TI D     100.00 g", ""),
        ("mt-sics", "Z I", "not executable now (Z I)"),
        ("mt-sics", "Z +", "upper limit exceeded (Z +)"),
        ("mt-sics", "T -", "lower limit exceeded (T -)"),
        ("mt-sics", 'I4 A "0123456789"', ""),
    ],
)
def test_answers_to_commands(dialect, line, refusal):
    assert parse_line(DIALECTS[dialect], line.encode()) == Answer(refusal)


@pytest.mark.parametrize(
    ("dialect", "line"),
    [
        ("openscale", "Readings:"),
        ("openscale", "12034,0.41"),
        ("openscale", "kg,25.81,0,"),
        ("openscale", "1,2,3,4,0.412,kg"),
        ("openscale", "12034,0.4.12,kg,"),
        ("and", "T,+001234.5  g"),
        ("and", "ST,+0012"),
        ("and", "ST,+1.2.3  g"),
        ("and", "EC,E"),
        ("mt-sics", "S     100.00 g"),
        ("mt-sics", "S S"),
        ("mt-sics", "S S \xff100.0 g"),
        ("mt-sics", ""),
    ],
)
def test_what_is_no_line_of_the_dialect_says_nothing(dialect, line):
    assert parse_line(DIALECTS[dialect], line.encode("latin-1")) is None


@given(st.sampled_from(sorted(DIALECTS)), st.binary(max_size=300) | st.from_regex(r"[STUZOLQ,+\-. 0-9Eaginxkg]{0,40}"))
def test_any_line_is_survived_and_a_weight_is_a_finite_number_or_says_why(dialect, line):
    said = parse_line(DIALECTS[dialect], line if isinstance(line, bytes) else line.encode())
    if isinstance(said, Reading):
        (value,) = said.sample.values
        assert math.isfinite(value) if not said.sample.fault else math.isnan(value)


@given(
    st.lists(st.binary(min_size=1, max_size=60).map(lambda b: b.replace(b"\r", b"r").replace(b"\n", b"n"))),
    st.lists(st.integers(0, 1000), max_size=10),
    st.sampled_from([b"\r\n", b"\n", b"\r", b"\r\n\r\n"]),
)
def test_lines_come_out_of_any_chunking(lines, cuts, end):
    data = b"".join(line + end for line in lines)
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    parser = LineParser(60)
    got = [line for a, b in itertools.pairwise(edges) for line in parser.feed(data[a:b])]
    assert got == lines and parser.pending == 0 and parser.skipped == 0


@given(st.lists(st.binary(max_size=200), max_size=20))
def test_endless_lines_are_dropped_in_bounded_memory(pieces):
    parser = LineParser(50)
    for piece in pieces:
        assert all(len(line) <= 50 for line in parser.feed(piece))
        assert parser.pending <= 50
    assert parser.feed(b"\nshort\n")[-1] == b"short"


@given(st.binary(max_size=100))
def test_even_parity_goes_and_comes(data):
    text = bytes(byte & 0x7F for byte in data)
    wire = add_even_parity(text)
    assert strip_even_parity(wire) == text and all(byte.bit_count() % 2 == 0 for byte in wire)


def test_a_bit_that_fell_over_is_seen_by_the_parity():
    assert strip_even_parity(bytes([add_even_parity(b"1")[0] ^ 4])) == b"?"
