"""The session of a scale without a line: any chunking, any bytes, refusals, silence."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.devices.scales import DIALECTS, ScaleLineSession
from tms_agents.devices.scales.emulator import AndScale, OpenScale, SicsScale
from tms_agents.devices.transport import DeviceFault

SAID = {
    "openscale": b"12034,0.412,kg,25.81,0,\r\n12534,0.413,kg,25.81,0,\r\n13034,-1.000,kg,25.81,0,\r\n",
    "and": b"ST,+001234.5  g\r\nUS,-000012.3  g\r\nOL,+9999999E+19\r\nST,+000000.0  g\r\n",
    "mt-sics": b"S S     100.00 g\r\nS D      -1.23 g\r\nS +\r\nS S       0.00 g\r\n",
}


@given(st.sampled_from(sorted(SAID)), st.lists(st.integers(0, 200), max_size=12), st.binary(max_size=20))
def test_any_chunking_gives_the_same_samples(dialect, cuts, end):
    data = SAID[dialect]
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    session = ScaleLineSession(dialect, mode="stream")
    pieces = [sample for a, b in itertools.pairwise(edges) for sample in session.receive(data[a:b])]
    whole = ScaleLineSession(dialect, mode="stream").receive(data)
    assert repr(pieces) == repr(whole) and len(whole) >= 2  # NaN differs from itself, not in print


@settings(max_examples=150)
@given(
    st.sampled_from(sorted(DIALECTS)),
    st.sampled_from(["poll", "stream"]),
    st.booleans(),
    st.lists(st.tuples(st.binary(max_size=300), st.floats(0, 2)), max_size=20),
)
def test_any_bytes_are_survived_in_bounded_memory(dialect, mode, parity, steps):
    now = 0.0
    session = ScaleLineSession(dialect, mode=mode, software_parity=parity, clock=lambda: now)
    session.opened()
    for data, seconds in steps:
        try:
            assert all(len(sample.values) == 1 for sample in session.receive(data))
        except DeviceFault:
            return
        now += seconds
        session.tick()
        assert session.pending <= 200 and len(session.output()) <= 20


@given(st.data(), st.sampled_from([AndScale, SicsScale, OpenScale]))
def test_an_emulator_survives_any_command(data, scale):
    device = scale(lambda t: 1.0)
    for piece in data.draw(st.lists(st.binary(max_size=40) | st.sampled_from([b"Q\r\n", b"Z\r\n", b"SIR\r\n", b"!"]))):
        device.receive(piece)
        device.tick()


def test_a_stream_is_asked_for_again_after_a_power_cycle():
    now = 0.0
    session = ScaleLineSession("mt-sics", mode="stream", reply_s=1.0, clock=lambda: now)
    session.opened()
    assert session.output() == b"SIR\r\n"
    for step in range(10):
        now = step * 0.3
        session.receive(b"S S     100.00 g\r\n")
        session.tick()
        assert session.output() == b""
    now += 1.5
    session.tick()
    assert session.output() == b"SIR\r\n" and session.closing() == b"SI\r\n"


def test_a_question_is_put_again_when_no_answer_comes():
    now = 0.0
    session = ScaleLineSession("and", poll_s=0.1, reply_s=0.5, clock=lambda: now)
    session.opened()
    assert session.output() == b"Q\r\n"
    now = 0.4
    session.tick()
    assert session.output() == b""
    now = 0.6
    session.receive(b"ST,+0012")
    session.tick()
    assert session.output() == b"Q\r\n" and session.pending == 0


def test_zero_and_tare_on_demand():
    device = SicsScale(lambda t: 42.0)
    session = ScaleLineSession("mt-sics", poll_s=0.0)
    session.opened()
    session.command("tare")
    for _ in range(6):
        samples = session.receive(device.receive(session.output()))
        session.tick()
    assert list(device.heard)[:2] == ["SI", "T"] and samples[0].values == (0.0,)
    session.command("zero")
    device.refuse_next = 2
    with pytest.raises(DeviceFault, match=r"the scale refuses Z: syntax error \(ES\)"):
        for _ in range(3):
            session.receive(device.receive(session.output()))
            session.tick()


def test_a_zero_command_without_any_answer_is_a_fault_where_answers_are_due():
    now = 0.0
    session = ScaleLineSession("mt-sics", zero_first=True, reply_s=0.5, clock=lambda: now)
    session.opened()
    now = 0.6
    with pytest.raises(DeviceFault, match="the scale does not answer Z"):
        session.tick()
