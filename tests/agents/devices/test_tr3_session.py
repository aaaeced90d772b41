"""TR3 sessions against the emulated reader: rounds, the field, refusals, and no statement that is not true."""

from __future__ import annotations

import pytest
from device_conversation import Clock, DisturbedLine, assert_true, converse, rounds
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.devices.tags import Field, RoundEnd, TagRead
from tms_agents.devices.tr3.codec import INVENTORY_OPTIONS, SUM_ERROR, Frame
from tms_agents.devices.tr3.emulator import Tr3Device
from tms_agents.devices.tr3.session import Tr3Session
from tms_agents.devices.transport import DeviceFault

UIDS = ("E00401004E17F97A", "E00401508747FFC8", "E0070000DEADBEEF", "E016040202030D0D")


def reader(antennas: int = 3, **tags: str) -> Tr3Device:
    """``a0=...`` puts a tag before antenna 0."""
    device = Tr3Device(antennas)
    for antenna, uid in tags.items():
        device.see(uid, int(antenna[1:]))
    return device


def session(clock: Clock, **options) -> Tr3Session:
    new = Tr3Session(poll_s=0.1, reply_s=0.3, clock=clock, **options)
    new.opened()
    return new


def test_every_antenna_of_every_cycle_ends_its_round_behind_its_reads():
    clock, device = Clock(), reader(a0=UIDS[0], a2=UIDS[1])
    items = converse(session(clock, antennas=(0, 1, 2)), device, clock, 0.95)
    assert rounds(items)[:6] == [(0, {UIDS[0]}), (1, set()), (2, {UIDS[1]})] * 2
    assert len(rounds(items)) == 30


def test_a_tag_that_leaves_is_missing_in_the_next_round():
    clock, device = Clock(), reader(a0=UIDS[0])
    host = session(clock)
    assert rounds(converse(host, device, clock, 0.5))[-1] == (0, {UIDS[0]})
    device.lose(UIDS[0])
    assert rounds(converse(host, device, clock, 0.5))[1:] == [(0, set())] * 4


def test_one_antenna_is_switched_to_and_fro_so_that_tags_are_read_again():
    clock, device = Clock(), reader(a0=UIDS[0])
    assert rounds(converse(session(clock), device, clock, 0.95)) == [(0, {UIDS[0]})] * 10
    switches = [frame.data[1] for frame in device.heard if frame.data[:1] == b"\x9c"]
    assert switches[:4] == [1, 0, 1, 0]


def test_a_reader_without_antenna_switch_makes_no_statement_until_it_has_repeated_a_tag():
    clock, device = Clock(), reader(a0=UIDS[0])
    device.switches_antennas = False
    items = converse(session(clock), device, clock, 1.0)
    assert [item.tag for item in items] == [UIDS[0]]  # as it never tells it again, its silence means nothing

    clock, device = Clock(), reader(a0=UIDS[0])
    device.switches_antennas, device.forgets_without_field = False, True
    host = session(clock)
    assert rounds(converse(host, device, clock, 0.95))[1:] == [(0, {UIDS[0]})] * 8
    device.lose(UIDS[0])
    assert rounds(converse(host, device, clock, 0.3))[-1] == (0, set())


def test_the_field_is_off_between_rounds_where_asked():
    clock, device = Clock(), reader(a0=UIDS[0], a1=UIDS[1])
    host = session(clock, antennas=(0, 1), rf_off_between_rounds=True, rest_antenna=2)
    converse(host, device, clock, 0.05)
    for _ in range(10):
        items = converse(host, device, clock, 0.1)
        assert rounds(items) == [(0, {UIDS[0]}), (1, {UIDS[1]})]
        assert device.radiating is None and device.antenna == 2
    clock, device = Clock(), reader(a0=UIDS[0])
    converse(session(clock), device, clock, 0.5)
    assert device.radiating == 0


@pytest.mark.parametrize("rests", [False, True])
def test_weighing_pauses_the_field_and_a_new_connection_keeps_it_off(rests):
    clock, device, field = Clock(), reader(a0=UIDS[0]), Field()
    host = session(clock, field=field, rf_off_between_rounds=rests)
    converse(host, device, clock, 0.33)
    host.pause()
    frames = host.frames
    items = converse(host, device, clock, 0.5)
    assert field.is_off and device.radiating is None and items == []
    assert host.frames >= frames + 5  # it shows that it is alive
    # switched off and on, it radiates until it is found out
    device.power_cycle_after = 3
    converse(host, device, clock, 0.12)
    assert device.radiating == 0
    converse(host, device, clock, 1.0)
    assert field.is_off and device.radiating is None
    # reconnected, to a reader that has been switched off and on and radiates
    device.rf_on = True
    host = session(clock, field=field)
    assert not field.is_off
    items = converse(host, device, clock, 0.5)
    assert field.is_off and device.radiating is None and items == []
    host.resume()
    assert rounds(converse(host, device, clock, 0.5))[0] == (0, {UIDS[0]}) and not field.is_off


def test_a_pause_in_the_middle_of_a_cycle_leaves_out_the_rounds_to_come():
    clock, device = Clock(), reader(a0=UIDS[0], a1=UIDS[1])
    host = session(clock, antennas=(0, 1))
    items = []
    while not any(isinstance(item, RoundEnd) for item in items):
        items += host.receive(device.receive(host.output()))
    host.pause()
    items += converse(host, device, clock, 0.5)
    assert rounds(items) == [(0, {UIDS[0]})] and host.field.is_off


@pytest.mark.parametrize("option", INVENTORY_OPTIONS)
def test_both_kinds_of_inventory(option):
    clock, device = Clock(), reader(a0=UIDS[0])
    device.inventory_options = (option,)
    assert rounds(converse(session(clock), device, clock, 1.0))[-1] == (0, {UIDS[0]})
    assert {frame.data[1] for frame in device.heard[8:] if frame.command == 0x78} == {option}


def test_a_command_that_arrived_damaged_is_sent_again_and_other_refusals_say_why():
    clock, device = Clock(), reader(a0=UIDS[0])
    device.nack_code, device.nack_next = SUM_ERROR, 2
    assert rounds(converse(session(clock), device, clock, 0.15)) == [(0, {UIDS[0]})] * 2
    device.inventory_options = ()
    with pytest.raises(DeviceFault, match="refuses command 02 00 78 03 F0 40 01 03 B1 0D: format error"):
        converse(session(clock), device, clock, 0.2)
    with pytest.raises(DeviceFault, match=r"refuses command 02 00 4E 02 9C 09 .*: format error"):
        converse(session(clock, antennas=(0, 9)), reader(), clock, 0.2)
    device.nack_code, device.nack_next = 0x17, 99
    with pytest.raises(DeviceFault, match="refusal code 17"):
        converse(session(clock), device, clock, 0.2)


def test_late_and_foreign_frames_are_no_reads():
    clock = Clock()
    host = session(clock)
    uid = Frame(0x49, b"\x00" + bytes.fromhex(UIDS[0])[::-1]).encode()
    assert host.receive(uid + Frame(0x30, b"\xf0\x00").encode()) == []  # the host has only set the mode
    device = reader()
    foreign = Frame(0x49, b"\x00" + bytes.fromhex("1234567890ABCDEF")[::-1]).encode()
    items = converse(host, device, clock, 0.5, line=lambda answer: foreign + answer)
    assert not any(isinstance(item, TagRead) for item in items)


TRUTH = {0: {UIDS[0], UIDS[1]}, 1: {UIDS[2]}, 2: set()}


def full_reader() -> Tr3Device:
    device = Tr3Device(3)
    for antenna, uids in TRUTH.items():
        for uid in sorted(uids):
            device.see(uid, antenna)
    return device


@pytest.mark.parametrize("antennas", [(0,), (0, 1, 2)])
def test_a_power_cycle_after_any_byte_costs_some_cycles_and_tells_nothing_wrong(antennas):
    for cut in range(160):
        clock, device = Clock(), full_reader()
        host = session(clock, antennas=antennas)
        device.power_cycle_after = cut
        items = converse(host, device, clock, 1.5)
        assert device.power_cycles == 1
        assert_true(items, TRUTH)
        assert len(rounds(items)) >= 8 * len(antennas), cut


damage = st.lists(
    st.tuples(
        st.integers(0, 60), st.integers(0, 200), st.sampled_from(["flip", "drop", "insert"]), st.integers(1, 255)
    ),
    max_size=12,
    unique_by=lambda harm: harm[0],  # two errors in one answer may cancel out in its sum
)


@given(damage, st.sampled_from([(0,), (0, 1), (0, 1, 2)]), st.booleans())
def test_a_disturbed_line_tells_nothing_wrong_and_recovers(harm, antennas, rests):
    clock, device = Clock(), full_reader()
    host = session(clock, antennas=antennas, rf_off_between_rounds=rests)
    items = converse(host, device, clock, 6.0, step_s=0.05, line=DisturbedLine(harm))
    assert_true(items, TRUTH)
    assert rounds(converse(host, device, clock, 1.0))
