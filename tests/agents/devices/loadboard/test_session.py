"""The board's session against its emulator, bytes and time in the test's hand: which cell a number is given to."""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.devices.loadboard import RosTmsBoardBurst, RosTmsBoardSession
from tms_agents.devices.loadboard.emulator import RosTmsBoardDevice
from tms_agents.devices.sessions import Asking, Prompt
from tms_agents.devices.transport import DeviceFault

#: Every cell has values that no other cell has, so that a mix-up shows.
CELLS = (1000, 2000, 3000, 4000)


@pytest.fixture(params=["plain", "short", "prompt"], autouse=True)
def ways(request, monkeypatch):
    """As any link may do it; by the short ways, as ours does; and by these when somebody waits for every sample."""
    monkeypatch.setattr(Wire, "ways", request.param)


class Wire:
    """A session and a board on one wire; ``run`` moves time on in steps of a millisecond."""

    ways = "plain"

    def __init__(self, device_options=None, kind=RosTmsBoardSession, **options) -> None:
        self.now = 0.0

        def clock():
            return self.now

        def counts(t):
            return [value + int(t * 50) % 900 for value in CELLS]

        self.device = RosTmsBoardDevice(counts, boot_s=0.05, clock=clock, **(device_options or {}))
        self.session = kind(clock=clock, **options)
        self.session.opened()
        self.noise = self.arrived = self.said = b""
        self.short = self.ways != "plain" and isinstance(self.session, Asking)
        if self.ways == "prompt":
            self.session.prompt = True
        self.due = 0.0

    def run(self, seconds: float, latency_s=lambda: 0.0) -> list:
        samples = []
        for _ in range(round(seconds * 1000)):
            self.now += 0.001
            self.device.delay_s = latency_s()
            arrived = self.device.receive(self.said + self.session.output()) + self.device.tick() + self.noise
            self.noise = self.said = b""
            self.arrived += arrived
            # As a link does: a polled session is looked after when it wants to be, any other one at every byte, too.
            if self.now < self.due and (getattr(self.session, "polled", False) or not self.arrived):
                continue
            if self.short and self.arrived and (question := self.session.answered(self.arrived)) is not None:
                self.arrived, self.said = b"", question
                if question or not self.session.prompt:
                    continue
            elif self.short and not self.arrived:
                self.session.nothing_by(self.now)
            for _ in range(2):
                if self.arrived:
                    samples += self.session.receive(self.arrived)
                    self.arrived = b""
                self.session.tick()
                if isinstance(self.session, Prompt):
                    samples += self.session.finished()
                if self.session.tick_s > 0:
                    break
            self.due = self.now + self.session.tick_s - 1e-6
        return samples


def right(samples) -> bool:
    return all(
        math.isnan(value) or base <= value < base + 900
        for sample in samples
        for value, base in zip(sample.values, CELLS, strict=True)
    )


@pytest.mark.parametrize("firmware", ["plain", "quoted", "ok", "ok-line"])
def test_every_firmware_is_read_fifty_times_a_second(firmware):
    samples = Wire({"firmware": firmware}).run(1.0)
    assert 40 <= len(samples) <= 50 and right(samples)
    assert not any(math.isnan(value) for sample in samples for value in sample.values)
    assert all(sample.fault == "" and sample.stable is None for sample in samples)


def test_a_late_answer_is_never_given_to_another_cell():
    wire = Wire(reply_s=0.02, late_s=0.06)
    rng = random.Random(4)
    samples = wire.run(20.0, lambda: rng.choice([0.0, 0.0, 0.0, 0.001, 0.03, 0.05]))
    assert len(samples) > 20 and right(samples)
    assert any(math.isnan(value) for sample in samples for value in sample.values)


def test_an_answer_too_late_even_for_the_pause_spoils_its_round_only():
    """The late line shifts the following answers by one cell; the line left over at the end gives it away."""
    wire = Wire(reply_s=0.02, late_s=0.04)
    wire.run(0.31, lambda: 0.002)
    wire.device.delay_s = 0.0
    hold = iter([0.075])
    samples = wire.run(0.5, lambda: next(hold, 0.002) if wire.session._asked == 1 else 0.002)
    assert right(samples) and samples
    assert wire.session.doubtful_rounds >= 1


def test_a_board_slower_than_expected_is_given_longer_pauses():
    """Answers up to 150 ms late where 60 were expected: a few rounds are lost until the pause is long enough."""
    wire = Wire(reply_s=0.02, late_s=0.04)
    rng = random.Random(6)
    samples = wire.run(30.0, lambda: rng.choice([0.0] * 60 + [0.002] * 20 + [0.08, 0.12, 0.15]))
    assert len(samples) > 100 and right(samples)
    assert 1 <= wire.session.doubtful_rounds <= 10


@pytest.mark.parametrize("left_over", [b"4321\r\n", b"43"])
def test_a_line_left_over_after_the_round_drops_it_too(left_over):
    wire = Wire()
    wire.run(0.5)
    while wire.session._asked is not None or not wire.session._open_round:
        wire.run(0.001)
    assert wire.session.doubtful_rounds == 0
    wire.noise = left_over
    samples = wire.run(0.05)
    assert samples == [] and wire.session.doubtful_rounds == 1
    assert right(wire.run(0.5))


def test_garbage_half_lines_and_power_cycles_cost_values_not_their_order():
    wire = Wire()
    good = len(wire.run(0.5))
    for fault in ("garble_next", "cut_next"):
        setattr(wire.device, fault, 2)
        samples = wire.run(2.0)
        assert right(samples) and any(math.isnan(value) for sample in samples for value in sample.values)
        assert not any(map(math.isnan, samples[-1].values))
    wire.noise = b"17\r\n1234"
    assert right(wire.run(0.5))
    wire.device.power_cycle()
    samples = wire.run(2.0)
    assert right(samples) and len(wire.run(0.5)) >= good - 5


def test_a_deaf_cell_is_named_and_does_not_slow_down_the_others():
    wire = Wire(retry_s=1.0)
    wire.device.deaf = {2}
    wire.run(1.0)
    samples = wire.run(4.0)
    assert len(samples) > 100 and right(samples)
    assert all(math.isnan(sample.values[2]) and sample.fault == "no answer from cell 2" for sample in samples)
    assert not any(math.isnan(sample.values[k]) for sample in samples for k in (0, 1, 3))
    wire.device.deaf = set()
    assert wire.run(2.0)[-1].fault == ""


def test_a_silent_board_gives_no_sign_of_life():
    wire = Wire()
    wire.run(0.2)
    frames = wire.session.frames
    wire.device.silent = True
    assert len(wire.run(3.0)) <= 1 and wire.session.frames == frames
    wire.device.silent = False
    assert wire.run(1.5)


def test_a_stuck_cell_is_reported_as_it_is():
    wire = Wire()
    wire.device.stuck = {1: 2222}
    assert {sample.values[1] for sample in wire.run(1.0)} == {2222.0}


def test_a_board_has_at_least_one_cell_and_an_index_for_each():
    with pytest.raises(ValueError, match="1 to 36 cells"):
        RosTmsBoardSession(cells=37)
    with pytest.raises(ValueError, match="1 to 36 cells"):
        RosTmsBoardSession(cells=0)


@settings(max_examples=100)
@given(
    st.lists(
        st.tuples(st.sampled_from(["data", "wait"]), st.binary(max_size=80), st.floats(0, 0.2)),
        max_size=30,
    )
)
def test_any_bytes_are_survived_in_bounded_memory(steps):
    now = 0.0
    session = RosTmsBoardSession(clock=lambda: now)
    session.opened()
    for what, data, seconds in steps:
        if what == "data":
            assert all(len(sample.values) == 4 for sample in session.receive(data))
        now += seconds
        session.tick()
        assert len(session.output()) <= 1 and session.pending <= 200


@pytest.mark.parametrize("firmware", ["plain", "quoted", "ok", "ok-line"])
def test_asked_all_at_once_every_firmware_is_read_fifty_times_a_second(firmware):
    samples = Wire({"firmware": firmware}, kind=RosTmsBoardBurst).run(3.0, lambda: 0.003)
    assert 85 <= len(samples) <= 100 and right(samples)  # after a second of quiet
    assert not any(math.isnan(value) for sample in samples for value in sample.values)


def test_asked_all_at_once_a_round_is_told_late_unless_somebody_waits_for_it():
    def delays(prompt: bool) -> list[float]:
        wire, late = Wire(kind=RosTmsBoardBurst), []
        wire.session.prompt = prompt
        wire.run(1.2)
        for _ in range(1000):
            late += [wire.now - (sample.values[0] - CELLS[0]) / 50 for sample in wire.run(0.001, lambda: 0.003)]
        return late

    # The value counts fiftieths of a second, so a delay is known to 0.02 s.
    assert min(delays(False)) > 0.03 and max(delays(True)) < 0.035


@settings(max_examples=30)
@given(st.integers(0, 2**32))
def test_asked_all_at_once_no_answer_is_given_to_another_cell(seed):
    """Late answers, garbage, cut frames and power cycles; every complete round that comes out is right."""
    rng = random.Random(seed)
    wire = Wire(kind=RosTmsBoardBurst)
    samples = []
    for _ in range(12):
        match rng.randrange(5):
            case 0:
                wire.noise = rng.choice([b"\xff\xfe7\r\n", b"?2", b"\r\n"])  # numbers have no check sum
            case 1:
                wire.device.cut_next = 1
            case 2:
                wire.device.garble_next = 1
            case 3:
                wire.device.power_cycle()
        samples += wire.run(0.7, lambda: rng.choice([0.0, 0.001, 0.01, 0.04, 0.3]) if rng.random() < 0.01 else 0.001)
    assert right(samples)
    assert len(wire.run(4.0, lambda: 0.001)) > 50


def test_asked_all_at_once_a_dead_cell_is_a_fault_that_says_what_to_do():
    wire = Wire(kind=RosTmsBoardBurst, quiet_s=0.05)
    assert wire.run(0.5)
    wire.device.deaf = {2}
    with pytest.raises(DeviceFault, match='3 answers to 4 questions, 10 times in a row; ask = "one"'):
        wire.run(5.0)
