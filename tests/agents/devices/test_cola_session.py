"""CoLa sessions against emulated scanners: dialects, models, set-up, refusals, faults, a clock that goes on."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import numpy as np
import pytest
from device_conversation import Clock, DisturbedLine
from hypothesis import given, settings
from hypothesis import strategies as st
from link_listening import QUICK, on_a_line, states, until

from tms_agents.devices.cola import MODELS, ColaDevice, ColaSession
from tms_agents.devices.cola import messages as m
from tms_agents.devices.cola.framing import Telegram
from tms_agents.devices.cola.scandata import Channel, ScanData
from tms_agents.devices.scans import Scan
from tms_agents.devices.sessions import DeviceFault, DeviceState
from tms_agents.devices.transport import Link

PASSWORD_S = 0x6FD62C05


class Room:
    """Every sweep differs from the others, and every beam from its neighbours: 1.2 m + 4 mm per beam + 40 mm sweeps."""

    def __init__(self, beams: int) -> None:
        self.number, self.beams = -1, beams

    def __call__(self):
        self.number += 1
        return self.ranges(self.number), np.arange(self.beams) % 250.0

    def ranges(self, number: int):
        return 1.2 + 0.004 * np.arange(self.beams) + 0.04 * (number % 10)


def converse(host, device, clock, seconds, line=bytes, step_s=0.02):
    scans = []
    for _ in range(round(seconds / step_s)):
        clock.now += step_s
        host.tick()
        said = host.output()
        answer = (device.receive(said) if said else b"") + device.tick()
        scans += host.receive(line(answer)) if answer else []
    return scans


def pair(model="TiM571", dialect="B", **options):
    clock = Clock()
    device = ColaDevice(lambda: device.room(), model=MODELS[model], dialect=dialect, clock=clock)
    device.room = Room(device.beams)
    host = ColaSession(clock=clock, **options)
    host.opened()
    return clock, device, host


def assert_true(scans, room):
    for scan in scans:
        number = round((scan.ranges[0] - 1.2) / 0.04)
        np.testing.assert_allclose(scan.ranges, room.ranges(number), atol=0.0011)


@pytest.mark.parametrize("dialect", ["A", "B"])
@pytest.mark.parametrize(
    ("model", "beams", "first_deg", "hz"),
    [("TiM571", 811, -135, 15), ("TiM781S", 811, -135, 15), ("LMS111", 541, -135, 50), ("LMS511", 1141, -95, 25)],
)
def test_models_in_both_dialects(model, beams, first_deg, hz, dialect):
    clock, device, host = pair(model, dialect)
    scans = converse(host, device, clock, 3.0)
    assert len(scans) >= 1.5 * hz and host.ready and host.condition == ""
    assert host.dialect == dialect and host.model.startswith(model) and host.serial == "21010042"
    assert_true(scans, device.room)
    scan = scans[-1]
    assert len(scan.ranges) == beams and (scan.intensities == np.arange(beams) % 250).all()
    assert np.rad2deg(scan.sweep.angles[[0, -1]]) == pytest.approx([first_deg, -first_deg])
    assert scan.sweep.period_s == pytest.approx(1 / hz) and scan.sweep.model == host.model
    assert len({id(one.sweep) for one in scans}) == 1
    steps = np.diff([one.device_time_s for one in scans])
    assert steps.mean() == pytest.approx(1 / hz, rel=0.05) and (steps > 0).all()
    device.receive(host.closing())
    assert not device.streaming


def test_safety_scanners_have_a_password_of_their_own():
    clock, device, host = pair("TiM781S")
    assert converse(host, device, clock, 1.0)
    assert device.heard.count("sMN SetAccessMode") == 2
    clock, device, host = pair("TiM781S", passwords=(PASSWORD_S,))
    assert converse(host, device, clock, 1.0)
    assert device.heard.count("sMN SetAccessMode") == 1
    clock, device, host = pair("TiM781S", passwords=(0xF4724744,))
    with pytest.raises(DeviceFault, match=r"TiM781S-2174104 V3\.13 refuses the password"):
        converse(host, device, clock, 1.0)


def test_what_is_not_to_be_changed_needs_no_login():
    clock, device, host = pair(intensities=None, passwords=())
    scans = converse(host, device, clock, 1.0)
    assert scans and scans[0].intensities is None
    assert not [name for name in device.heard if name.startswith(("sMN", "sWN"))]
    with pytest.raises(DeviceFault, match="needs a login"):
        pair(passwords=())


def test_pace_resolution_and_field_of_view():
    clock, device, host = pair("LMS111", frequency_hz=25, resolution_deg=0.25)
    device.room = Room(1081)
    device.settle_s = 10.0
    assert converse(host, device, clock, 10.0) == []
    scans = converse(host, device, clock, 2.0)
    assert len(scans[0].ranges) == 1081 and scans[0].sweep.period_s == pytest.approx(0.04)
    assert_true(scans, device.room)
    clock, device, host = pair("TiM571", field_deg=(0.0, 180.0), resolution_deg=1 / 3)
    device.room = Room(541)
    scans = converse(host, device, clock, 2.0)
    assert np.rad2deg(scans[0].sweep.angles[[0, -1]]) == pytest.approx([-90, 90]) and len(scans[0].ranges) == 541
    assert_true(scans, device.room)
    for options, why in [
        ({"frequency_hz": 33, "resolution_deg": 0.5}, "refuses the scan: that pace is not possible"),
        ({"frequency_hz": 50, "resolution_deg": 0.4}, "refuses the scan: that resolution is not possible"),
        ({"field_deg": (-90, 90), "resolution_deg": 0.5}, "refuses sWN LMPoutputRange: error 4: not possible now"),
    ]:
        clock, device, host = pair("LMS111", **options)
        with pytest.raises(DeviceFault, match=why):
            converse(host, device, clock, 2.0)
    clock, device, host = pair("TiM571", frequency_hz=25, resolution_deg=0.5)
    with pytest.raises(DeviceFault, match="refuses sMN mLMPsetscancfg: error 2: unknown method"):
        converse(host, device, clock, 2.0)
    clock, device, host = pair("TiM571", frequency_hz=15, resolution_deg=0.3333, intensities=None, passwords=())
    assert converse(host, device, clock, 2.0)  # as it is: nothing to change, nothing to log in for
    with pytest.raises(ValueError, match="together with a resolution"):
        ColaSession(frequency_hz=25)
    with pytest.raises(ValueError, match="together with a pace or field of view"):
        ColaSession(resolution_deg=0.5)


@pytest.mark.parametrize("dialect", ["A", "B"])
def test_refusals_are_said_and_those_that_do_no_harm_are_passed_over(dialect):
    clock, device, host = pair(dialect=dialect)
    device.refuse = {"DeviceIdent": 3, "SerialNumber": 3, "SCdevicestate": 3, "LMCstartmeas": 2}
    assert converse(host, device, clock, 3.0) and host.model == ""
    for name, code, why in [
        ("LMDscandata", 15, "refuses sEN LMDscandata: error 15: unknown event"),
        ("LMDscandatacfg", 1, "refuses sWN LMDscandatacfg: error 1: the login does not allow it"),
        ("Run", 200, "refuses sMN Run: error 200"),
    ]:
        clock, device, host = pair(dialect=dialect)
        device.refuse = {name: code}
        with pytest.raises(DeviceFault, match=why):
            converse(host, device, clock, 3.0)


def test_questions_that_are_never_answered():
    clock, device, host = pair()
    device.unknown = {"DeviceIdent", "SerialNumber"}
    assert converse(host, device, clock, 6.0)
    clock, device, host = pair()
    device.unknown = {"LMDscandatacfg"}
    with pytest.raises(DeviceFault, match="does not answer sWN LMDscandatacfg"):
        converse(host, device, clock, 6.0)
    clock, device, host = pair()
    device.silent = True
    with pytest.raises(DeviceFault, match="the scanner does not answer sRN SCdevicestate"):
        converse(host, device, clock, 12.0)
    clock, device, host = pair(dialect="A")
    host = ColaSession(dialect="B", clock=clock)
    host.opened()
    with pytest.raises(DeviceFault, match="does not answer"):
        converse(host, device, clock, 12.0)
    assert host.closing() == b""  # nobody there to stop


def test_states_and_pollution():
    clock, device, host = pair()
    device.state = m.DEVICE_ERROR
    with pytest.raises(DeviceFault, match="reports an error"):
        converse(host, device, clock, 1.0)
    clock, device, host = pair()
    device.status = (0, 2)
    assert converse(host, device, clock, 1.0) and host.condition == "the window is polluted"
    device.status = (0, 0)
    assert converse(host, device, clock, 1.0) and host.condition == ""
    device.status = (0, 1)
    with pytest.raises(DeviceFault, match="TiM571-2050101 V3.13 reports: an error".replace(".", r"\.")):
        converse(host, device, clock, 1.0)


def test_the_clock_goes_on_where_that_of_the_device_begins_anew():
    clock, device, host = pair()
    device._started = clock.now - (2**32 - 1_500_000) / 1e6  # of its 32 bits of microseconds
    times = [scan.device_time_s for scan in converse(host, device, clock, 4.0)]
    assert np.diff(times) == pytest.approx(np.full(len(times) - 1, 1 / 15), abs=0.021)
    assert times[0] < 2**32 / 1e6 < times[-1]


def test_a_scanner_switched_off_and_on_is_set_up_again_but_not_for_ever():
    clock, device, host = pair()
    assert converse(host, device, clock, 1.0)
    device.power_cycle()
    scans = converse(host, device, clock, 6.0)
    assert len(scans) > 20 and scans[-1].intensities is not None
    assert_true(scans, device.room)
    device.tick = lambda: b""
    with pytest.raises(DeviceFault, match="answers, but sends no scans"):
        converse(host, device, clock, 40.0)


@pytest.mark.parametrize("dialect", ["A", "B"])
@pytest.mark.parametrize("fault", ["garble_next", "cut_next"])
def test_damaged_telegrams_are_left_out(fault, dialect):
    clock, device, host = pair(dialect=dialect)
    converse(host, device, clock, 3.0)
    setattr(device, fault, 3)
    scans = converse(host, device, clock, 3.0)
    assert 35 <= len(scans) <= 43
    assert_true(scans, device.room)


def tell(host, data: ScanData) -> list[Scan]:
    return host.receive(data.telegram("B").encode())


def test_other_layers_channels_and_nonsense():
    clock, device, host = pair()
    converse(host, device, clock, 1.0)
    near = np.array([1000, 2000], np.uint16)
    first = Channel("DIST1", near)
    (scan,) = tell(host, ScanData((Channel("RSSI1", near[:1]), Channel("DIST2", near * 2), first)))
    assert scan.ranges.tolist() == [1.0, 2.0] and scan.intensities is None  # not one per beam
    assert tell(host, ScanData((first,), layer=-250)) == []
    with pytest.raises(DeviceFault, match="sends no distances of a first echo"):
        tell(host, ScanData((Channel("RSSI1", near),)))
    broken = Telegram(b"sSN LMDscandata \x00\x01", "B").encode()
    assert host.receive(4 * broken) == []
    with pytest.raises(DeviceFault, match="cannot be understood: the telegram is shorter"):
        host.receive(broken)
    assert host.receive(Telegram(b"sSN LFErec \x00\x01", "B").encode() + Telegram(b"s", "A").encode()) == []


def test_the_answer_to_one_question_is_none_to_another():
    clock, device, host = pair()
    host.output()
    host.receive(Telegram(b"sRA Somethingelse \x02", "B").encode() + Telegram(b"sSN LIDinputstate \x00", "B").encode())
    assert host.output() == b""  # it waits
    assert converse(host, device, clock, 3.0)


def test_a_method_may_say_that_it_has_begun_and_take_its_time():
    clock, device, host = pair("LMS111", frequency_hz=25, resolution_deg=0.5)
    answer, device.unknown = device.receive, {"mLMPsetscancfg"}
    assert converse(host, device, clock, 8.0) == [] and device.heard.count("sMN mLMPsetscancfg") == 1
    assert host.receive(Telegram(b"sMA mLMPsetscancfg", "B").encode()) == []
    device.unknown = set()
    host.receive(answer(m.scan_config(25, 0.5, -45, 225).ask("B").encode()))
    assert converse(host, device, clock, 2.0)


KINDS = st.sampled_from(["flip", "drop", "insert"])
HARM = st.tuples(st.integers(0, 25), st.integers(0, 3400), KINDS, st.integers(1, 255))
damage = st.lists(HARM, max_size=4, unique_by=lambda harm: harm[0])


@settings(max_examples=8)
@given(damage)
def test_a_disturbed_line_tells_nothing_wrong_and_recovers(harm):
    """One error in a telegram of CoLa B: two like ones cancel out in its sum. CoLa A has none and relies on TCP."""
    clock, device, host = pair(dialect="B")
    line = DisturbedLine(harm)
    for _ in range(5):
        try:
            scans = converse(host, device, clock, 5.0, line, step_s=0.05)
        except DeviceFault:  # as the link does, it begins anew
            host = ColaSession(clock=clock)
            host.opened()
        else:
            assert_true(scans, device.room)
    assert len(scans) > 5 and host.ready


@pytest.mark.parametrize("dialect", ["A", "B"])
async def test_scans_come_over_a_port_and_after_a_cut(dialect):
    room = Room(811)
    device = ColaDevice(room, dialect=dialect)
    async with on_a_line("tcp", device, tick_s=0.01) as (port, opener):
        cut = False

        def hang_up(item):
            nonlocal cut
            if isinstance(item, Scan) and not cut:
                cut = True
                port.hang_up()

        link = Link(opener, ColaSession, name="floor", retry=QUICK)
        seen = await until(
            link, lambda seen: "faulty" in states(seen) and isinstance(seen[-1], Scan), hang_up, timeout_s=20
        )
        assert states(seen) == ["connected", "faulty", "connected"]
        assert_true([item for item in seen if isinstance(item, Scan)], room)
        async with asyncio.timeout(20):
            while device.streaming:  # the last word of the link
                await asyncio.sleep(0.01)


async def test_a_refusal_is_the_state_of_the_link():
    device = ColaDevice(Room(811))
    device.refuse = {"LMDscandata": 15}
    async with on_a_line("tcp", device, tick_s=0.01) as (_, opener):
        link = Link(opener, ColaSession, name="floor", retry=QUICK)
        (state,) = await until(link, lambda seen: states(seen), timeout_s=20)
    why = "floor: TiM571-2050101 V3.13 refuses sEN LMDscandata: error 15: unknown event"
    assert state == DeviceState("faulty", why)


async def test_a_mirror_that_takes_its_time_to_another_pace_is_waited_for_and_not_set_again():
    device = ColaDevice(Room(541), model=MODELS["LMS111"])
    device.settle_s = 6.0
    async with on_a_line("tcp", device, tick_s=0.01) as (port, opener):

        def hang_up(item):
            if isinstance(item, Scan) and device.heard.count("sRN DeviceIdent") == 1:
                port.hang_up()

        link = Link(
            opener,
            lambda: ColaSession(frequency_hz=25, resolution_deg=0.5),
            name="floor",
            silent_after_s=1.0,
            retry=QUICK,
        )
        seen = await until(
            link, lambda seen: "faulty" in states(seen) and isinstance(seen[-1], Scan), hang_up, timeout_s=20
        )
    assert states(seen) == ["connected", "faulty", "connected"]
    assert all(scan.sweep.period_s == pytest.approx(0.04) for scan in seen if isinstance(scan, Scan))
    assert device.heard.count("sMN mLMPsetscancfg") == 1


async def test_a_device_of_the_other_dialect_is_not_called_silent_while_it_is_found_out():
    device = ColaDevice(Room(811), dialect="A")
    async with on_a_line("tcp", device, tick_s=0.01) as (_, opener):
        link = Link(opener, ColaSession, name="floor", silent_after_s=0.3, retry=QUICK)
        seen = await until(link, lambda seen: isinstance(seen[-1], Scan), timeout_s=20)
    assert states(seen) == ["connected"]


@pytest.mark.parametrize("dialect", ["A", "B"])
async def test_a_refused_login_stays_the_reason_over_new_connections(dialect):
    device = ColaDevice(Room(811), model=replace(MODELS["TiM571"], password=1), dialect=dialect)
    async with on_a_line("tcp", device, tick_s=0.01) as (_, opener):

        async def mend_at_the_third_connection():
            while device.heard.count("sMN SetAccessMode") < 3 * len(m.PASSWORDS):
                await asyncio.sleep(0.02)
            device.model = MODELS["TiM571"]

        link = Link(opener, ColaSession, name="floor", silent_after_s=0.5, retry=QUICK)
        mending = asyncio.create_task(mend_at_the_third_connection())
        seen = await until(link, lambda seen: isinstance(seen[-1], Scan), timeout_s=20)
        await mending
    assert states(seen) == ["faulty", "connected"]


async def test_pollution_is_told_with_the_state_while_it_goes_on():
    device = ColaDevice(Room(811))
    async with on_a_line("tcp", device, tick_s=0.01) as (_, opener):

        def pollute(item):
            if isinstance(item, Scan):
                device.status = (0, 2) if len(told) < 2 else (0, 0)
            else:
                told.append(item)

        told: list[DeviceState] = []
        link = Link(opener, ColaSession, name="floor", retry=QUICK)
        seen = await until(link, lambda seen: len(states(seen)) == 3, pollute, timeout_s=20)
    well = DeviceState("connected", "floor: TiM571-2050101 V3.13")
    polluted = DeviceState("connected", "floor: TiM571-2050101 V3.13, the window is polluted")
    assert [item for item in seen if isinstance(item, DeviceState)] == [well, polluted, well]
