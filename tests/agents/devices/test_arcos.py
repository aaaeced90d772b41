"""Pioneer robots: packets against published bytes, odometry through wraps and resets, sessions against the emulator."""

from __future__ import annotations

import math

import pytest
from device_conversation import Clock, DisturbedLine
from hypothesis import given, settings
from hypothesis import strategies as st
from link_listening import QUICK, on_a_line, states, until

from tms_agents.devices.arcos import ArcosSession, BaseStatus, Odometry, PioneerDevice, codec
from tms_agents.devices.arcos.codec import Packet, PacketParser, argument_of, command
from tms_agents.devices.arcos.sip import Status, parse_status
from tms_agents.devices.transport import Link

#: From a host program for the P3-DX and from AriaCoda, other people's both.
PUBLISHED = [
    (command(codec.SYNC0), "FA FB 03 00 00 00"),
    (command(codec.SYNC1), "FA FB 03 01 00 01"),
    (command(codec.SYNC2), "FA FB 03 02 00 02"),
    (command(codec.SONAR, 0), "FA FB 06 1C 3B 00 00 1C 3B"),
    (command(5, 1000), "FA FB 06 05 3B E8 03 ED 3E"),
    (command(5, -1000), "FA FB 06 05 1B E8 03 ED 1E"),
    (command(codec.ENABLE, 0), "FA FB 06 04 3B 00 00 04 3B"),
    (command(codec.ENABLE, 1), "FA FB 06 04 3B 01 00 05 3B"),
    (Packet(codec.SETO, b"\x3b"), "FA FB 04 07 3B 07 3B"),
    (command(codec.VEL, 200), "FA FB 06 0B 3B C8 00 D3 3B"),
    (command(codec.VEL, -200), "FA FB 06 0B 1B C8 00 D3 1B"),
    (command(codec.RVEL, 10), "FA FB 06 15 3B 0A 00 1F 3B"),
    (command(50, 4), "FA FB 06 32 3B 04 00 36 3B"),
]

packets = st.builds(Packet, st.integers(0, 255), st.binary(max_size=codec.MAX_DATA))


@pytest.mark.parametrize(("packet", "published"), PUBLISHED)
def test_packets_are_those_that_others_send(packet: Packet, published: str) -> None:
    assert packet.encode() == bytes.fromhex(published)
    assert PacketParser().feed(bytes.fromhex(published)) == [packet]


@given(st.lists(packets, max_size=5), st.data())
def test_packets_come_through_in_pieces(sent: list[Packet], data: st.DataObject) -> None:
    stream, parser, found, at = b"".join(one.encode() for one in sent), PacketParser(), [], 0
    while at < len(stream):
        end = data.draw(st.integers(at + 1, len(stream)))
        found += parser.feed(stream[at:end])
        at = end
    assert found == sent and parser.pending == parser.skipped == 0


@given(st.binary(max_size=300).filter(lambda junk: b"\xfa" not in junk), packets, st.binary(max_size=600))
def test_garbage_is_skipped_and_little_is_held(junk: bytes, packet: Packet, more: bytes) -> None:
    parser = PacketParser()
    assert parser.feed(junk + packet.encode()) == [packet] and parser.skipped == len(junk)
    parser.feed(more)
    assert parser.pending < codec.MAX_PACKET


@given(st.integers(-0xFFFF, 0xFFFF) | st.text(st.characters(max_codepoint=255), max_size=190))
def test_arguments_travel_unchanged(argument: int | str) -> None:
    assert argument_of(command(7, argument)) == argument


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="16 bits"):
        command(codec.VEL, 1 << 16)
    with pytest.raises(ValueError, match="bytes of data"):
        Packet(1, bytes(codec.MAX_DATA + 1)).encode()


shorts = st.integers(-(2**15), 2**15 - 1)
statuses = st.builds(
    Status,
    moving=st.booleans(),
    x=st.integers(0, 0x7FFF),
    y=st.integers(0, 0x7FFF),
    heading=shorts,
    left=shorts,
    right=shorts,
    battery=st.integers(0, 255),
    stalled_left=st.booleans(),
    stalled_right=st.booleans(),
    front=st.integers(0, 127),
    rear=st.integers(0, 127),
    motors=st.booleans(),
    sonars=st.lists(st.tuples(st.integers(0, 255), st.integers(0, 0xFFFF)), max_size=16).map(tuple),
    rotation=st.none() | shorts,
)


@given(statuses)
def test_states_travel_unchanged(status: Status) -> None:
    assert parse_status(status.encode()) == status


@given(statuses, st.integers(0, 60))
def test_a_state_that_is_cut_off_is_none(status: Status, kept: int) -> None:
    packet = status.encode()
    found = parse_status(Packet(packet.id, packet.data[: min(kept, 18)]))
    assert found is None or len(packet.data) <= 18


def driven(way: list[tuple[float, float]]) -> list[tuple[float, float, float]]:
    """Poses (m, m, rad) of steps (m ahead, rad)."""
    poses = [(0.0, 0.0, 0.0)]
    for ahead, turn in way:
        x, y, theta = poses[-1]
        poses.append((x + ahead * math.cos(theta), y + ahead * math.sin(theta), theta + turn))
    return poses


def raw(pose: tuple[float, float, float]) -> tuple[int, int, int]:
    x, y, theta = pose
    heading = round(math.remainder(theta, math.tau) * 4096 / math.tau)
    return round(1000 * x) & 0x7FFF, round(1000 * y) & 0x7FFF, heading


@given(st.lists(st.tuples(st.floats(-0.15, 0.15), st.floats(-0.2, 0.2)), min_size=1, max_size=60), st.floats(-400, 400))
def test_odometry_goes_on_through_all_wraps(way: list[tuple[float, float]], begin: float) -> None:
    """Also 33 m away, where 15 bits are full; it is right within what rounding to 1 mm and a 4096th turn does."""
    odometry = Odometry()
    poses = driven(way)
    for n, (x, y, theta) in enumerate(poses):
        odometry.take(raw((x + begin, y - begin, theta)), 0.1 * n, 1.0)
    x, y, theta = poses[-1]
    assert math.hypot(odometry.pose[0] - x, odometry.pose[1] - y) < 0.002 + 0.002 * len(way)
    assert odometry.pose[2] == pytest.approx(theta, abs=0.002) and odometry.resets == 0


def test_a_reset_is_no_motion() -> None:
    odometry = Odometry()
    odometry.take((5000, 100, 1024), 0.0, 1.0)
    odometry.take((5000, 200, 1024), 0.1, 1.0)  # 0.1 m ahead, whatever the robot calls it
    before = odometry.pose
    assert before == pytest.approx((0.1, 0.0, 0.0), abs=1e-9)
    odometry.take((0, 0, 0), 0.2, 1.0)
    assert odometry.pose == before and odometry.resets == 1
    odometry.take((50, 0, 0), 0.3, 1.0)
    assert odometry.pose == pytest.approx((0.15, 0.0, 0.0), abs=1e-9)


def converse(session, device, clock, seconds, *, line=bytes, step_s=0.02) -> list[BaseStatus]:
    items: list[BaseStatus] = []
    for _ in range(round(seconds / step_s)):
        clock.now += step_s
        session.tick()
        said = session.output()
        answer = line((device.receive(said) if said else b"") + device.tick())
        items += session.receive(answer) if answer else []
    return items


def pair(**options):
    clock = Clock()
    device = PioneerDevice(clock=clock, **options.pop("device", {}))
    session = ArcosSession(clock=clock, **options)
    session.opened()
    return clock, device, session


def test_it_opens_listens_and_closes() -> None:
    clock, device, session = pair()
    items = converse(session, device, clock, 5.0)
    assert session.ready and session.note == "p3dx-sh Emulated"
    assert 44 <= len(items) <= 50 and items[-1].battery_v == 12.6 and not items[-1].moving
    assert [one.id for one in device.heard][:6] == [0, 1, 2, codec.OPEN, codec.SONAR, codec.PULSE]
    assert not device.motors  # nobody asked for it to be driven
    with pytest.raises(ValueError, match="listens"):
        session.drive(0.1, 0.0)
    device.receive(session.closing())
    assert not device.open


@pytest.mark.parametrize("modern", [True, False])
@pytest.mark.parametrize("model", ["p3dx-sh", "p3at", "p2dx"])
def test_it_drives(model: str, modern: bool) -> None:
    clock, device, session = pair(drives=True, device={"model": model})
    device.modern = modern
    converse(session, device, clock, 1.0)
    assert device.motors
    session.drive(0.3, 0.5)
    items = converse(session, device, clock, 10.0)
    assert items[-1].moving and items[-1].speed == pytest.approx(0.3, abs=0.01)
    assert items[-1].turn == pytest.approx(0.5, abs=0.03)
    theta = items[-1].pose[2]
    assert 4.7 < theta < 5.1  # through the wrap of its heading
    # A circle of 0.3 / 0.5 m; positions are told in whole units.
    assert items[-1].pose[0] == pytest.approx(0.6 * math.sin(theta), abs=0.03)
    assert items[-1].pose[1] == pytest.approx(0.6 * (1 - math.cos(theta)), abs=0.03)


def test_it_stops_when_nobody_cares() -> None:
    clock, device, session = pair(drives=True)
    converse(session, device, clock, 1.0)
    session.drive(0.3, 0.0)
    converse(session, device, clock, 5.0)
    assert device.speed == 0.3  # signs of life keep it going
    clock.now += 3.0
    device.tick()
    assert device.speed == 0.0


def test_a_robot_that_was_left_open_is_closed_first() -> None:
    clock, device, session = pair()
    converse(session, device, clock, 1.0)
    again = ArcosSession(clock=clock)
    again.opened()
    items = converse(again, device, clock, 2.0)
    assert again.ready and len(items) > 5
    assert codec.CLOSE in [one.id for one in device.heard]


def test_a_robot_that_restarts_is_opened_again_and_odometry_goes_on() -> None:
    clock, device, session = pair(drives=True)
    converse(session, device, clock, 1.0)
    session.drive(0.5, 0.0)
    before = converse(session, device, clock, 4.0)[-1].pose
    device.power_cycle()
    after = converse(session, device, clock, 4.0)
    assert before[0] > 1.9 and after[-1].pose == pytest.approx(before, abs=0.06)
    session.drive(0.5, 0.0)
    assert converse(session, device, clock, 2.0)[-1].pose[0] > after[-1].pose[0] + 0.9


@settings(max_examples=60)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 150), st.integers(0, 60), st.sampled_from(["flip", "drop", "insert"]), st.integers(1, 255)
        ),
        max_size=40,
        unique_by=lambda harm: harm[0],  # two errors in one packet may cancel out in its sum
    )
)
def test_no_damage_on_the_line_moves_the_robot(harm: list[tuple[int, int, str, int]]) -> None:
    clock, device, session = pair()
    items = converse(session, device, clock, 4.0, line=DisturbedLine(harm))
    assert all(one.pose == (0, 0, 0) and one.battery_v == 12.6 for one in items)
    assert converse(session, device, clock, 3.0)


@pytest.mark.parametrize("line", ["pty", "tcp"])
async def test_over_a_line_through_garbage_and_a_pulled_cable(line: str) -> None:
    device = PioneerDevice()
    async with on_a_line(line, device, 9600, tick_s=0.02) as (cable, opener):
        odometry = Odometry()
        link = Link(
            opener,
            lambda: ArcosSession(odometry=odometry, drives=True, reply_s=0.1),
            name="base",
            tick_s=0.02,
            silent_after_s=0.3,
            retry=QUICK,
        )
        cut = []

        def disturb(item: object) -> None:
            if isinstance(item, BaseStatus) and not cut:
                cut.append(item)
                cable.inject(b"\xfa\xfb\x10garbage\xfa")
                cable.hang_up()
                if line == "pty":
                    cable.plug_in()

        def back(seen: list[object]) -> bool:
            return len(cut) > 0 and states(seen).count("connected") == 2 and isinstance(seen[-1], BaseStatus)

        seen = await until(link, back, disturb)
        assert states(seen) == ["connected", "faulty", "connected"]


async def test_a_robot_falls_silent_over_tcp() -> None:
    device = PioneerDevice(motion=lambda: (1.0, 2.0, 0.5))
    async with on_a_line("tcp", device, 9600, tick_s=0.02) as (_, opener):
        options = {"silent_after_s": 0.3, "tick_s": 0.02, "retry": QUICK}
        link = Link(opener, lambda: ArcosSession(reply_s=0.1), name="base", **options)

        def hush(item: object) -> None:
            device.silent = isinstance(item, BaseStatus)

        seen = await until(link, lambda seen: states(seen)[-1:] == ["connected"] and "silent" in states(seen), hush)
        assert states(seen)[:2] == ["connected", "silent"]
