"""tshark, an independent decoder, judges what our LLRP client and our emulated reader send (``make peers``)."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
import struct
import subprocess
from pathlib import Path

import pytest
from sllurp_client import sllurp_reads

from tms_agents.devices.llrp.codec import FrameParser, Message, Parameter, encode
from tms_agents.devices.llrp.emulator import LlrpEmulator
from tms_agents.devices.llrp.session import LlrpSession
from tms_agents.devices.llrp.tables import MESSAGE_TYPES
from tms_agents.devices.tags import RoundEnd, TagRead
from tms_agents.devices.transport import DeviceState, Link, tcp

pytestmark = [
    pytest.mark.peer,
    pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed"),
]

EPC = "30352B2E4401D3000000007B"
PORT = 5084
#: What was said: True for the client.
Talk = list[tuple[bool, bytes]]


class Recorder:
    """A port that passes everything on to a reader and keeps it."""

    def __init__(self, port: int) -> None:
        self.talk: Talk = []
        self._to = port

    async def __aenter__(self) -> Recorder:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        self._server.close()
        await asyncio.sleep(0.05)  # what was sent last is on its way

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._to)
        await asyncio.gather(self._pass(reader, far_writer, True), self._pass(far_reader, writer, False))

    async def _pass(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter, client: bool) -> None:
        with contextlib.suppress(ConnectionError):
            while data := await source.read(1 << 16):
                self.talk.append((client, data))
                sink.write(data)
        sink.close()


def pcap(talk: Talk) -> bytes:
    """A capture file (raw IPv4) of one TCP connection in which this was said."""
    raw = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 1 << 16, 101)
    sent = {True: 1, False: 1}
    for number, (client, data) in enumerate(talk):
        for at in range(0, len(data), 1400):
            piece = data[at : at + 1400]
            ports = (40000, PORT) if client else (PORT, 40000)
            head = struct.pack(">HHIIBBHHH", *ports, sent[client], sent[not client], 5 << 4, 0x18, 65535, 0, 0)
            sent[client] += len(piece)
            ends = (b"\x7f\x00\x00\x01", b"\x7f\x00\x00\x02")
            packet = struct.pack(">BBHHHBBH", 0x45, 0, 40 + len(piece), number & 0xFFFF, 0, 64, 6, 0)
            packet += b"".join(ends if client else ends[::-1]) + head + piece
            raw += struct.pack("<IIII", number, 0, len(packet), len(packet)) + packet
    return raw


def judge(talk: Talk, folder: Path) -> tuple[list[int], str]:
    """Types of the messages that tshark finds, and whatever it objects to."""
    file = folder / "talk.pcap"
    file.write_bytes(pcap(talk))
    fields = [word for name in ("llrp.type", "_ws.malformed", "_ws.expert.message") for word in ("-e", name)]
    done = subprocess.run(
        ["tshark", "-n", "-r", str(file), "-d", f"tcp.port=={PORT},llrp", "-Y", "llrp", "-T", "fields", *fields],
        capture_output=True,
        text=True,
        check=True,
    )
    types, objections = [], []
    for line in done.stdout.splitlines():
        found, *complaints = line.split("\t")
        types += [int(one) for one in found.split(",")]
        objections += [one for one in complaints if one]
    return types, " ".join(objections)


def said(talk: Talk) -> list[int]:
    """Types of the messages in their order, per direction what our codec finds."""
    parsers = {True: FrameParser(), False: FrameParser()}
    return [MESSAGE_TYPES[message.name] for client, data in talk for message in parsers[client].feed(data)]


@pytest.mark.parametrize("round_s", [None, 0.05], ids=["at once", "in rounds"])
async def test_what_our_client_and_our_reader_say(round_s, tmp_path):
    async with LlrpEmulator(period_s=0.02) as reader, Recorder(reader.port) as recorder:
        for antenna in range(1, 4):
            reader.see(f"{EPC[:-1]}{antenna}", antenna=antenna)
        reader.see("E0040150", antenna=2)  # not 96 bits
        session = LlrpSession(antennas=(1, 2, 3), keepalive_s=0.05, round_s=round_s)
        link = Link(tcp("127.0.0.1", recorder.port), lambda: session, name="reader", tick_s=0.02)
        reads = ends = 0
        async with asyncio.timeout(10), contextlib.aclosing(link.listen()) as groups:
            async for group in groups:
                for item in [] if isinstance(group, DeviceState) else group:
                    reads += isinstance(item, TagRead)
                    ends += isinstance(item, RoundEnd)
                if reads > 20 and (ends > 6 or round_s is None) and reader.acknowledged:
                    break
        if round_s:
            reader.unplug(3)
            reader.lose_reports()
        await asyncio.sleep(0.1)
    types, objections = judge(recorder.talk, tmp_path)
    assert objections == "" and sorted(types) == sorted(said(recorder.talk))
    names = ["SET_READER_CONFIG", "ADD_ROSPEC", "RO_ACCESS_REPORT", "KEEPALIVE", "KEEPALIVE_ACK", "CLOSE_CONNECTION"]
    assert {MESSAGE_TYPES[name] for name in names} <= set(types)


async def test_what_our_reader_says_to_sllurp(tmp_path):
    async with LlrpEmulator(period_s=0.02) as reader, Recorder(reader.port) as recorder:
        reader.see(EPC, antenna=2)
        assert await sllurp_reads(recorder.port, antennas=[1, 2], report_every_n_tags=1) == {(EPC, 2)}
    types, objections = judge(recorder.talk, tmp_path)
    assert objections == "" and sorted(types) == sorted(said(recorder.talk))
    assert MESSAGE_TYPES["GET_READER_CAPABILITIES_RESPONSE"] in types


def test_the_judge_objects_to_a_message_that_is_wrong(tmp_path):
    right = encode(Message("KEEPALIVE", id=1)) + encode(
        Message("DELETE_ROSPEC_RESPONSE", {}, (Parameter("LLRPStatus", {"StatusCode": 0, "ErrorDescription": ""}),))
    )
    assert judge([(False, right)], tmp_path) == ([62, 31], "")
    wrong = bytearray(right)
    wrong[-5] = 200  # the parameter claims to be longer than the message
    assert judge([(False, bytes(wrong))], tmp_path)[1] != ""
