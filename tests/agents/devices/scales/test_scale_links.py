"""Scales behind real terminals and ports, each dialect with its emulator."""

from __future__ import annotations

import asyncio
import contextlib
import math

import pytest
from link_listening import QUICK, on_a_line, samples, states, until

from tms_agents.devices.emulation import PtyLine, TcpLine
from tms_agents.devices.loads import LoadSample
from tms_agents.devices.scales import DIALECTS, LoadGroup, ScaleLineSession
from tms_agents.devices.scales.emulator import AndScale, OpenScale, SicsScale
from tms_agents.devices.transport import DeviceState, Link, serial, tcp

SCALES = {"openscale": OpenScale, "and": AndScale, "mt-sics": SicsScale}


def scale(opener, dialect, link=None, **options) -> Link[LoadSample]:
    link = {"silent_after_s": 0.6, "tick_s": 0.01, "retry": QUICK, **(link or {})}
    options = {"poll_s": 0.02, "reply_s": 0.2, **options}
    return Link(opener, lambda: ScaleLineSession(dialect, **options), name="scale", **link)


@pytest.mark.parametrize("kind", ["pty", "tcp"])
@pytest.mark.parametrize("mode", ["poll", "stream"])
@pytest.mark.parametrize("dialect", sorted(SCALES))
async def test_weights_come_over_a_line(dialect, mode, kind):
    device = SCALES[dialect](lambda t: 412.3, unit="kg", decimals=4, period_s=0.02)
    if dialect == "openscale" and mode == "poll":
        device.trigger = "!"
    async with on_a_line(kind, device, tick_s=0.01) as (_, opener):
        seen = await until(scale(opener, dialect, mode=mode), lambda seen: len(samples(seen)) == 4)
        assert states(seen) == ["connected"]
        assert [sample.values[0] for sample in samples(seen)] == pytest.approx([412.3] * 4)
        assert {sample.stable for sample in samples(seen)} == {None if dialect == "openscale" else True}
        await asyncio.sleep(0.03)
        if dialect == "and" and mode == "stream":
            assert device.heard[-1] == "C"  # left quiet


@pytest.mark.parametrize("firmware", ["1.0", "1.2"])
@pytest.mark.parametrize("timestamp", [True, False])
@pytest.mark.parametrize("raw", [True, False])
@pytest.mark.parametrize("temperatures", [(True, True), (True, False), (False, False)])
def test_every_column_setting_of_openscale(firmware, timestamp, raw, temperatures):
    device = OpenScale(lambda t: -75.5, unit="lbs", decimals=5)
    device.firmware, device.timestamp, device.raw, device.trigger = firmware, timestamp, raw, "!"
    device.local_c, device.remote_c = temperatures
    session = ScaleLineSession("openscale")
    assert session.receive(device.receive(b"!")) == []  # the first line may be half a line
    (sample,) = session.receive(device.receive(b"!"))
    assert sample.values == pytest.approx((-75.5,), abs=0.003)


@pytest.mark.parametrize("dialect", ["and", "mt-sics"])
async def test_zero_first_then_load_overload_and_unstable(dialect):
    load = 250.0
    device = SCALES[dialect](lambda t: load, capacity_g=3000.0)
    device.acknowledge = False  # a setting of A&D: the driver goes on without

    async with TcpLine(device) as line:
        link = scale(tcp("127.0.0.1", line.port), dialect, zero_first=True)

        def put(item):
            nonlocal load
            if isinstance(item, LoadSample):
                load = 350.0 if load == 250.0 else 4000.0

        seen = await until(link, lambda seen: samples(seen) and samples(seen)[-1].fault, put)
        values = [sample.values[0] for sample in samples(seen)]
        assert device.heard[0] == "Z" and values[0] == 0.0 and 100.0 in values
        assert math.isnan(values[-1]) and samples(seen)[-1].fault == "overload"


async def test_a_moving_load_is_called_unstable():
    device = SicsScale(lambda t: 1000 * (t % 1))
    async with TcpLine(device) as line:
        link = scale(tcp("127.0.0.1", line.port), "mt-sics")
        await until(link, lambda seen: samples(seen) and samples(seen)[-1].stable is False)


@pytest.mark.parametrize(
    ("dialect", "why"),
    [
        ("and", "scale: the scale refuses Q: undefined command (EC,E01)"),
        ("mt-sics", "scale: the scale refuses SI: syntax error (ES)"),
    ],
)
async def test_refused_commands_say_why_and_one_alone_is_forgiven(dialect, why):
    device = SCALES[dialect](lambda t: 5.0)
    device.refuse_next = 1
    async with TcpLine(device) as line:
        link = scale(tcp("127.0.0.1", line.port), dialect)
        assert states(await until(link, lambda seen: len(samples(seen)) == 2)) == ["connected"]
        device.refuse_next = 3
        seen = await until(link, lambda seen: "faulty" in states(seen) and isinstance(seen[-1], LoadSample))
        assert why in {item.why for item in seen if isinstance(item, DeviceState)}


async def test_a_scale_that_cannot_be_zeroed_says_why():
    device = SicsScale(lambda t: 1000 * t)
    async with TcpLine(device) as line:
        link = scale(tcp("127.0.0.1", line.port), "mt-sics", zero_first=True)
        (state,) = await until(link, lambda seen: True)
        assert state.state == "faulty"
        assert state.why == "scale: the scale refuses Z: upper limit exceeded (Z +)"


def test_openscale_is_tared_from_its_own_menu():
    with pytest.raises(ValueError, match="no zero command"):
        ScaleLineSession("openscale", zero_first=True)


async def test_seven_bits_even_parity_on_the_wire():
    """A&D ship with 7E1: seen over a converter that knows 8N1 only, both directions carry the parity bit."""
    assert (DIALECTS["and"].baud, DIALECTS["and"].bits, DIALECTS["and"].parity) == (2400, 7, "E")
    device = AndScale(lambda t: 88.5, software_parity=True)
    wire = bytearray()
    answer = device.receive

    def listen(data):
        wire.extend(data)
        reply = answer(data)
        wire.extend(reply)
        return reply

    device.receive = listen
    async with PtyLine(device) as line:
        opener = serial(line.path, 2400)
        seen = await until(scale(opener, "and", software_parity=True), lambda seen: len(samples(seen)) == 2)
        assert samples(seen)[0].values == (88.5,)
        assert wire and all(byte.bit_count() % 2 == 0 for byte in wire)
        assert any(byte > 0x7F for byte in wire)
        # without parity the scale hears no command and its letters are none
        (state,) = await until(scale(opener, "and", {"silent_after_s": 0.1}), lambda seen: True)
        assert state.state == "silent"


async def test_the_port_is_opened_with_the_settings_of_the_dialect(monkeypatch):
    """A pseudo terminal ignores bits and parity, so the opened port itself is asked for them."""
    import serial as pyserial

    ports = []

    class Port(pyserial.Serial):
        def __init__(self, *args, **kwargs):
            super().__init__(*args, **kwargs)
            ports.append(self)

    monkeypatch.setattr(pyserial, "Serial", Port)
    device = AndScale(lambda t: 1.0)
    async with PtyLine(device) as line:
        table = DIALECTS["and"]
        opener = serial(line.path, table.baud, bits=table.bits, parity=table.parity)
        seen = await until(scale(opener, "and"), samples)
        assert samples(seen)[0].values == (1.0,)
    assert [(port.baudrate, port.bytesize, port.parity, port.stopbits) for port in ports] == [(2400, 7, "E", 1)]


@pytest.mark.parametrize("dialect", sorted(SCALES))
async def test_power_cycle_garbage_and_a_pulled_cable(dialect):
    device = SCALES[dialect](lambda t: 300.0, period_s=0.02, unit="kg" if dialect == "openscale" else "g", boot_s=0.1)
    async with PtyLine(device, tick_s=0.005) as line:
        count = 0

        def disturb(item):
            nonlocal count
            if not isinstance(item, LoadSample):
                return
            count += 1
            if count == 2:
                line.inject(b"\xff\x00ST,+12\r\nS S   1\r\n12,0.")
            if count == 4:
                device.power_cycle()
            if count == 6:
                line.hang_up()
                asyncio.get_running_loop().call_later(0.1, line.plug_in)

        link = scale(serial(line.path, 9600), dialect, mode="stream")
        seen = await until(link, lambda seen: count > 7 and isinstance(seen[-1], LoadSample), disturb)
        assert states(seen)[0] == states(seen)[-1] == "connected" and "faulty" in states(seen)
        assert [sample.values[0] for sample in samples(seen)] == pytest.approx([300.0] * len(samples(seen)))


def test_half_a_line_is_no_weight():
    """A cut line can look like a whole one; it differs from the line before in its columns or digits."""
    session = ScaleLineSession("openscale", mode="stream")
    whole = b"12034,0.412,kg,25.81,0,\r\n"
    got = session.receive(b"412,kg,25.81,0,\r\n" + whole + whole + b"2,kg,25.81,0,\r\n" + whole + whole)
    assert [sample.values[0] for sample in got] == [pytest.approx(412.0)] * 2 and session.doubtful == 4
    session = ScaleLineSession("and", mode="stream")
    whole = b"ST,+001234.5  g\r\n"
    got = session.receive(whole + whole + b"ST,+00234.5  g\r\n" + whole + whole)
    assert {sample.values[0] for sample in got} == {1234.5} and len(got) == 2


async def test_four_scales_are_one_board():
    loads = [10.0, 20.0, 30.0, 40.0]
    devices = [SicsScale(lambda t, k=k: loads[k]) for k in range(4)]
    async with contextlib.AsyncExitStack() as stack:
        lines = [await stack.enter_async_context(TcpLine(device)) for device in devices]
        links = [scale(tcp("127.0.0.1", line.port), "mt-sics") for line in lines]
        group = LoadGroup(links, period_s=0.02, stale_s=0.25)
        hushed = False

        def hush(item):
            nonlocal hushed
            if isinstance(item, LoadSample) and not any(map(math.isnan, item.values)) and not hushed:
                hushed = True
                devices[2].silent = True
            if isinstance(item, DeviceState) and item.state == "silent":
                devices[2].silent = False

        def back(seen):
            return "silent" in states(seen) and states(seen)[-1] == "connected" and not samples(seen)[-1].fault

        seen = await until(group, back, hush)
        assert states(seen) == ["connected", "silent", "connected"]
        assert samples(seen)[-1] == LoadSample(values=(10.0, 20.0, 30.0, 40.0), stable=True)
        gone = [sample for sample in samples(seen) if "scale 3: nothing for 0.25 s" in sample.fault]
        assert gone and all(math.isnan(sample.values[2]) and sample.values[3] == 40.0 for sample in gone)


def test_a_group_needs_a_number_of_cells_for_each_source():
    with pytest.raises(ValueError, match="1 numbers of cells for 0 scales"):
        LoadGroup([], cells=[1])
