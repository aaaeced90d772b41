"""LMS2xx sessions against the emulated scanner: set-up, all kinds of output, faults, and no scan that is not true."""

from __future__ import annotations

import numpy as np
import pytest
from device_conversation import Clock, DisturbedLine
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.devices.lms200 import Lms200Device, Lms200Session
from tms_agents.devices.lms200 import messages as m
from tms_agents.devices.lms200.codec import Frame, FrameParser
from tms_agents.devices.sessions import DeviceFault

STOP = m.switch_mode(m.ON_REQUEST)


class Room:
    """Every sweep differs from the others, and every beam from its neighbours: 1.25 m + 4 mm per beam + sweep mm."""

    def __init__(self, beams: int = 361) -> None:
        self.number, self.beams = -1, beams

    def __call__(self):
        self.number += 1
        return self.ranges(self.number), np.arange(self.beams) % 200.0

    def ranges(self, number: int):
        return 1.25 + 0.004 * np.arange(self.beams) + 0.001 * (number % 4)


def converse(host, device, clock, seconds, line=bytes, step_s=0.02):
    scans = []
    for _ in range(round(seconds / step_s)):
        clock.now += step_s
        host.tick()
        said = host.output()
        answer = (device.receive(said) if said else b"") + device.tick()
        scans += host.receive(line(answer)) if answer else []
    return scans


def pair(room=None, *, baud=38400, fast=False, indices=False, **options):
    clock = Clock()
    device = Lms200Device(room or Room(), clock=clock, fast=fast, indices=indices)
    device.baud = baud
    host = Lms200Session(clock=clock, **options)
    host.opened()
    return clock, device, host


def assert_true(scans, room):
    for scan in scans:
        number = round((scan.ranges[0] - 1.25) * 1000)
        np.testing.assert_allclose(scan.ranges, room.ranges(number), atol=1e-9)


def test_streams_whole_scans_and_stops_at_the_end():
    room = Room()
    clock, device, host = pair(room)
    scans = converse(host, device, clock, 3.0)
    assert host.ready and host.model == "LMS200;30106;V02.10" and host.condition == ""
    assert 11 <= len(scans) <= 14  # 4.7 a second
    assert_true(scans, room)
    assert len({id(scan.sweep) for scan in scans}) == 1 and scans[0].intensities is None
    assert scans[0].sweep.model == host.model and scans[0].device_time_s is None
    assert device.writes == 0  # the memory of the device does not wear out
    device.receive(host.closing())
    assert not device.streaming and device.mode == m.ON_REQUEST
    assert [body[0] for body in device.heard] == [0x20, 0x3A, 0x74, 0x3B, 0x31, 0x20, 0x20]


def test_a_scan_of_several_turns_can_come_turn_by_turn():
    room = Room()
    clock, device, host = pair(room, output="partial")
    scans = converse(host, device, clock, 2.0)
    assert {len(scan.ranges) for scan in scans} == {180, 181}
    for scan in scans:
        degrees = np.rad2deg(scan.sweep.angles) + 90
        beams = np.round(degrees * 2).astype(int)
        assert np.diff(degrees) == pytest.approx(np.ones(len(degrees) - 1))
        number = round((scan.ranges[0] - 1.25 - 0.004 * beams[0]) * 1000)
        np.testing.assert_allclose(scan.ranges, room.ranges(number)[beams], atol=1e-9)


def test_one_scan_at_a_time_on_request():
    room = Room()
    clock, device, host = pair(room, output="request")
    scans = converse(host, device, clock, 1.0)
    assert len(scans) > 25 and not device.streaming
    assert_true(scans, room)


def test_reflectivity_of_the_models_that_have_it():
    room = Room(181)
    clock, device, host = pair(room, fast=True, output="reflectivity", angle_deg=None, resolution_deg=None, baud=500000)
    scans = converse(host, device, clock, 1.0)
    assert len(scans) > 20
    assert_true(scans, room)
    assert all((scan.intensities == np.arange(181)).all() for scan in scans)
    assert np.rad2deg(scans[0].sweep.angles[[0, -1]]) == pytest.approx([-45, 45])
    clock, device, host = pair(output="reflectivity")
    with pytest.raises(DeviceFault, match=r"refuses to send scans \(reflectivity\)"):
        converse(host, device, clock, 3.0)


def test_real_time_indices_behind_the_values_do_not_matter():
    room = Room()
    clock, device, host = pair(room, indices=True)
    scans = converse(host, device, clock, 2.0)
    assert scans
    assert_true(scans, room)


def test_field_of_view_unit_and_measuring_mode_are_set_and_written_once():
    clock, device, host = pair(Room(401), angle_deg=100, resolution_deg=0.25, unit="cm", measuring_mode=5)
    scans = converse(host, device, clock, 3.0)
    assert len(scans[0].ranges) == 401 and scans[0].ranges[0] == pytest.approx(1.25, abs=0.005)
    assert scans[0].sweep.range_max_m == 80.0
    assert device.writes == 1 and device.config.unit == "cm" and device.config.measuring_mode == 5
    again = Lms200Session(clock=clock, angle_deg=100, resolution_deg=0.25, unit="cm", measuring_mode=5)
    again.opened()
    assert converse(again, device, clock, 3.0) and device.writes == 1


def test_settings_that_cannot_be_are_refused_before_anything_is_sent():
    with pytest.raises(ValueError, match=r"0\.25 degrees"):
        Lms200Session(angle_deg=180, resolution_deg=0.25)
    with pytest.raises(ValueError, match="measuring mode 3F"):
        Lms200Session(measuring_mode=0x3F)
    with pytest.raises(ValueError, match="together"):
        Lms200Session(angle_deg=None)


def test_echoes_errors_and_pollution():
    ranges = np.full(361, 2.0)
    ranges[[3, 4, 5]] = np.inf, np.nan, 30.0
    clock, device, host = pair(lambda: (ranges, None))
    scan = converse(host, device, clock, 1.5)[-1]
    assert scan.ranges[3] == np.inf and np.isnan(scan.ranges[4]) and scan.ranges[5] == np.inf
    assert (np.delete(scan.ranges, [3, 4, 5]) == 2.0).all()
    device.trouble = 0x82
    assert converse(host, device, clock, 1.0) and host.condition == "warning, the window is polluted"
    device.trouble = 0
    assert converse(host, device, clock, 1.0) and host.condition == ""
    device.trouble = 0x04
    with pytest.raises(DeviceFault, match="the scanner reports: fatal error"):
        converse(host, device, clock, 1.0)


def test_not_heard_is_said_again_and_refusals_say_why():
    clock, device, host = pair()
    converse(host, device, clock, 0.02)
    device.nak_next = 2
    assert converse(host, device, clock, 2.0)
    clock, device, host = pair()
    converse(host, device, clock, 0.02)
    device.nak_next = 3
    with pytest.raises(DeviceFault, match="did not hear when told to tell its type"):
        converse(host, device, clock, 2.0)
    for code, why in [
        (m.VARIANT, "refuses the angle and resolution"),
        (m.SWITCH_MODE, "refuses to stop"),
        (m.WRITE_CONFIG, "refuses the measuring mode or unit"),
    ]:
        clock, device, host = pair(unit="cm")
        device.refuse = {code}
        with pytest.raises(DeviceFault, match=why):
            converse(host, device, clock, 3.0)
    clock, device, host = pair(fast=True)
    with pytest.raises(DeviceFault, match=r"does not know how to scan 180 degrees in steps of 0\.5"):
        converse(host, device, clock, 3.0)


def test_the_end_of_a_scan_that_was_under_way_is_no_complaint():
    """The host comes while the device streams values that have the byte "not heard" in them."""
    clock, device, host = pair(lambda: (np.full(361, 5.397), None))  # 1515 hex
    device.angle_deg, device.resolution_deg, device.mode = 180, 0.5, m.STREAM
    scan = device.tick()
    assert scan.count(b"\x15") > 700
    said = host.output()
    host.receive(scan[100:])
    assert host.output() == b""  # nothing is said again
    host.receive(device.receive(said))
    assert converse(host, device, clock, 3.0)


def test_silence_is_a_fault_in_the_end():
    clock, device, host = pair()
    device.silent = True
    with pytest.raises(DeviceFault, match="does not answer when told to stop"):
        converse(host, device, clock, 12.0)


def test_a_scanner_switched_off_and_on_is_set_up_again():
    room = Room()
    clock, device, host = pair(room)
    assert converse(host, device, clock, 2.0)
    device.power_cycle()
    device.baud = 38400  # set up to keep its rate
    scans = converse(host, device, clock, 3.0)
    assert len(scans) > 5 and device.angle_deg == 180 and device.resolution_deg == 0.5
    assert_true(scans, room)


def test_a_scanner_that_stops_is_started_again_but_not_for_ever():
    room = Room()
    clock, device, host = pair(room)
    converse(host, device, clock, 2.0)
    device.receive(Frame(STOP).encode())  # by someone else
    assert converse(host, device, clock, 4.5)
    device.tick = lambda: b""  # type: ignore[method-assign]
    with pytest.raises(DeviceFault, match="answers, but does not scan"):
        converse(host, device, clock, 30.0)


@pytest.mark.parametrize("fault", ["garble_next", "cut_next"])
def test_damaged_telegrams_are_left_out(fault):
    room = Room()
    clock, device, host = pair(room)
    before = converse(host, device, clock, 2.0)
    setattr(device, fault, 3)
    after = converse(host, device, clock, 3.0)
    assert len(after) >= len(before) - 1
    assert_true(after, room)


def test_the_device_says_when_it_was_not_heard():
    device = Lms200Device(Room())
    raw = bytearray(Frame(STOP).encode())
    raw[-1] ^= 1
    assert device.receive(bytes(raw)).endswith(b"\x15")
    assert device.receive(Frame(m.installation(b"wrong!!!")).encode())[0] == 0x06
    assert device.mode == m.ON_REQUEST
    (reply,) = FrameParser().feed(device.receive(Frame(m.installation(b"wrong!!!")).encode()))
    assert reply.data == b"\x01"
    (reply,) = FrameParser().feed(device.receive(Frame(bytes([m.WRITE_CONFIG]) + bytes(34)).encode()))
    assert reply.data[:1] == b"\x00" and device.writes == 0  # not in its installation mode


@pytest.mark.realdata
def test_a_recorded_scan_of_a_device_that_was_set_up(shared_data):
    clock, device, host = pair()
    converse(host, device, clock, 1.0)
    raw = (shared_data / "devices" / "sick_lms200" / "usick_b0_361pts.bin").read_bytes()
    (scan,) = host.receive(raw[:300]) + host.receive(raw[300:])
    assert scan.ranges[:4] == pytest.approx([2.251, 2.251, 2.242, 2.242]) and len(scan.ranges) == 361
    assert np.rad2deg(scan.sweep.angles[[0, 180, 360]]) == pytest.approx([-90, 0, 90])
    assert host.condition == "" and scan.intensities is None


KINDS = st.sampled_from(["flip", "drop", "insert"])
HARM = st.tuples(st.integers(0, 25), st.integers(0, 800), KINDS, st.integers(1, 255))
damage = st.lists(HARM, max_size=4, unique_by=lambda harm: harm[0])


@settings(max_examples=12)
@given(damage, st.sampled_from(["stream", "request"]))
def test_a_disturbed_line_tells_nothing_wrong_and_recovers(harm, output):
    room = Room(181)
    clock, device, host = pair(room, output=output, resolution_deg=1.0)
    line = DisturbedLine(harm)
    for _ in range(5):
        try:
            scans = converse(host, device, clock, 3.0, line, step_s=0.05)
        except DeviceFault:  # as the link does, it begins anew
            host = Lms200Session(output=output, resolution_deg=1.0, clock=clock)
            host.opened()
        else:
            assert_true(scans, room)
    assert len(scans) > 5 and host.ready
