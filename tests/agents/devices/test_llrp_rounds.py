"""LLRP sessions that read in rounds, against the emulated reader over TCP and against written messages."""

from __future__ import annotations

import asyncio
import contextlib

import pytest
from device_conversation import rounds
from link_listening import QUICK, states
from sllurp_client import sllurp_reads

from tms_agents.devices.llrp import messages
from tms_agents.devices.llrp.codec import FrameParser, Message, Parameter, encode
from tms_agents.devices.llrp.emulator import LlrpEmulator
from tms_agents.devices.llrp.session import LlrpSession
from tms_agents.devices.tags import RoundEnd, TagItem, TagRead
from tms_agents.devices.transport import DeviceState, Link, tcp

EPCS = ("30352B2E4401D3000000007B", "E200322FE20DF9311328B7E3", "3074257BF7194E4000001A85")


def link(port: int, antennas=(1, 2, 3)) -> Link[TagItem]:
    return Link(
        tcp("127.0.0.1", port),
        lambda: LlrpSession(antennas=antennas, keepalive_s=0.1, round_s=0.03),
        name="reader",
        silent_after_s=0.5,
        tick_s=0.02,
        retry=QUICK,
    )


async def listen(link: Link[TagItem], ends: int, act=lambda seen: None) -> list[TagItem | DeviceState]:
    """Everything until so many rounds have ended; ``act`` is called after each group."""
    seen: list[TagItem | DeviceState] = []
    async with asyncio.timeout(10), contextlib.aclosing(link.listen()) as groups:
        async for group in groups:
            seen += [group] if isinstance(group, DeviceState) else group
            act(seen)
            if sum(isinstance(item, RoundEnd) for item in seen) >= ends:
                return seen
    raise AssertionError("the link ended")


def items(seen) -> list[TagItem]:
    return [item for item in seen if not isinstance(item, DeviceState)]


@pytest.mark.parametrize("late", [False, True], ids=["report before end", "end before report"])
async def test_antennas_take_turns_and_each_end_stands_for_a_whole_round(late):
    async with LlrpEmulator(period_s=0.01) as reader:
        reader.reports_late = late
        reader.see(EPCS[0], antenna=1)
        reader.see(EPCS[1], antenna=1)
        reader.see(EPCS[2], antenna=3)
        seen = await listen(link(reader.port), 9)
        truth = {1: {EPCS[0], EPCS[1]}, 2: set(), 3: {EPCS[2]}}
        found = rounds(items(seen))
        assert [antenna for antenna, _ in found] == [1, 2, 3] * 3
        assert all(tags == truth[antenna] for antenna, tags in found)


async def test_a_tag_that_leaves_is_missing_and_its_reader_keeps_its_state():
    async with LlrpEmulator(period_s=0.01) as reader:
        reader.see(EPCS[0], antenna=1)

        def leave(seen):
            if RoundEnd(1) in seen:
                reader.lose(EPCS[0])

        seen = await listen(link(reader.port), 9, leave)
        assert rounds(items(seen))[0] == (1, {EPCS[0]}) and rounds(items(seen))[6] == (1, set())
        assert [item for item in seen if isinstance(item, DeviceState)] == [DeviceState("connected", "reader")]


async def test_all_antennas_as_one():
    async with LlrpEmulator(period_s=0.01) as reader:
        reader.see(EPCS[0], antenna=2)
        seen = await listen(link(reader.port, antennas=(0,)), 2)
        assert TagRead in map(type, seen) and seen[-1] == RoundEnd(0)
        assert {item.antenna for item in items(seen) if isinstance(item, TagRead)} == {2}


@pytest.mark.parametrize("before", [True, False], ids=["unplugged before", "unplugged meanwhile"])
async def test_an_unplugged_antenna_makes_no_statement(before):
    async with LlrpEmulator(period_s=0.01) as reader:
        reader.see(EPCS[0], antenna=2)
        if before:
            reader.unplug(2)
            seen = await listen(link(reader.port), 6)
            assert {antenna for antenna, _ in rounds(items(seen))} == {1, 3}
            return
        pulled: list[int] = []

        def pull(seen):
            if RoundEnd(2) in seen and not pulled:
                reader.unplug(2)
                pulled.append(len(seen))
            elif reader.unplugged and len(seen) > pulled[0] + 8:
                reader.plug_in(2)

        seen = await listen(link(reader.port), 20, pull)
        found = rounds(items(seen))
        assert all(tags == ({EPCS[0]} if antenna == 2 else set()) for antenna, tags in found)
        assert sum(antenna == 2 for antenna, _ in found) >= 2


async def test_a_power_cycle_in_the_middle_of_a_message():
    async with LlrpEmulator(period_s=0.01) as reader:
        reader.see(EPCS[0], antenna=1)
        cycles: list[int] = []

        def cycle(seen):
            if len(cycles) < 3 and sum(isinstance(item, RoundEnd) for item in seen) > 3 * len(cycles):
                cycles.append(len(seen))
                reader.power_cycle()

        seen = await listen(link(reader.port), 12, cycle)
        assert len(cycles) == 3
        assert states(seen) == ["connected", *["faulty", "connected"] * 3]
        assert all(tags == ({EPCS[0]} if antenna == 1 else set()) for antenna, tags in rounds(items(seen)))


def event(what: Parameter) -> bytes:
    data = Parameter("ReaderEventNotificationData", {}, (Parameter("UTCTimestamp", {"Microseconds": 1}), what))
    return encode(Message("READER_EVENT_NOTIFICATION", {}, (data,)))


def ended(turn: int, rospec: int = messages.ROSPEC_ID) -> bytes:
    return event(Parameter("AISpecEvent", {"EventType": 0, "ROSpecID": rospec, "SpecIndex": turn}))


def test_lost_reports_make_the_next_end_no_statement():
    session = LlrpSession(antennas=(1, 2), round_s=1.0)
    assert session.receive(ended(1) + ended(2)) == []
    assert session.receive(ended(1) + ended(2)) == [RoundEnd(1), RoundEnd(2)]
    assert session.receive(event(Parameter("ReportBufferOverflowErrorEvent")) + ended(1)) == []
    assert session.receive(ended(1)) == [RoundEnd(1)]
    # of another client, or of a turn that does not exist
    assert session.receive(ended(1, rospec=7) + ended(3) + ended(0)) == []


def test_a_reader_that_does_not_tell_about_its_antennas_is_taken_as_it_is():
    session = LlrpSession(antennas=(1,), round_s=0.2)
    session.receive(event(Parameter("ConnectionAttemptEvent", {"Status": 0})))
    refusal = Parameter("LLRPStatus", {"StatusCode": 402, "ErrorDescription": "unsupported"})
    sent: list[str] = []
    for answer in (messages.success(), refusal, *[messages.success()] * 3):
        (command,) = FrameParser().feed(session.output())
        sent.append(command.name)
        session.receive(encode(Message(f"{command.name}_RESPONSE", {}, (answer,))))
    assert sent == ["SET_READER_CONFIG", "GET_READER_CONFIG", "DELETE_ROSPEC", "ADD_ROSPEC", "ENABLE_ROSPEC"]
    assert session.ready


def test_what_the_rounds_are_made_of():
    (rospec,) = messages.add_round_rospec((2, 5), 250).children
    boundary, *turns, report = rospec.children
    start = boundary.find("ROSpecStartTrigger")
    period = start.find("PeriodicTriggerValue")
    assert start.number("ROSpecStartTriggerType") == 2 and period.number("Period") > 2 * 250
    assert [turn.values["AntennaIDs"] for turn in turns] == [(2,), (5,)]
    assert {turn.find("AISpecStopTrigger").number("DurationTrigger") for turn in turns} == {250}
    assert (report.number("ROReportTrigger"), report.number("N")) == (1, 0)


async def test_sllurp_reads_several_antennas_of_the_emulator():
    async with LlrpEmulator(period_s=0.02) as reader:
        for antenna, epc in enumerate(EPCS, 1):
            reader.see(epc, antenna=antenna)
        got = await sllurp_reads(reader.port, 2, antennas=[1, 3], report_every_n_tags=1)
    assert got == {(EPCS[0], 1), (EPCS[2], 3)}
