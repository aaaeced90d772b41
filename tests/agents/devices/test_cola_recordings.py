"""Recorded conversations with SICK devices: every telegram decodes, and our commands are those that were sent."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from device_conversation import Clock

from tms_agents.devices.cola import ColaSession
from tms_agents.devices.cola import messages as m
from tms_agents.devices.cola.framing import FrameParser
from tms_agents.devices.cola.scandata import ScanData
from tms_agents.devices.cola.values import Reader

pytestmark = pytest.mark.realdata


@pytest.fixture(scope="module")
def folder(shared_data) -> Path:
    return shared_data / "devices" / "sick_cola"


def scans_of(raw: bytes) -> list[ScanData]:
    parser = FrameParser()
    readers = [Reader(telegram) for telegram in parser.feed(raw)]
    assert parser.skipped == parser.pending == 0
    return [ScanData.of(reader) for reader in readers if (reader.verb, reader.name) == ("sSN", "LMDscandata")]


def talk(path: Path) -> Iterator[tuple[str, bytes]]:
    """Direction and telegram."""
    for line in path.read_text().splitlines():
        if not line.startswith("#"):
            yield line[0], bytes.fromhex(line.split()[-1])


def payloads(path: Path) -> list[bytes]:
    """TCP payloads of a capture that was converted to JSON."""
    layers = [packet["_source"]["layers"]["tcp"] for packet in json.loads(path.read_text())]
    return [bytes.fromhex(layer["tcp.payload"].replace(":", "")) for layer in layers]


def segments(path: Path) -> list[bytes]:
    """TCP payloads of a pcapng file with Ethernet and IPv4, of any one order of bytes; nothing else is looked at."""
    raw, found, at = path.read_bytes(), [], 0
    while at < len(raw):
        kind, size = int.from_bytes(raw[at : at + 4], "little"), int.from_bytes(raw[at + 4 : at + 8], "little")
        if kind == 6:  # enhanced packet
            length = int.from_bytes(raw[at + 20 : at + 24], "little")
            packet = raw[at + 28 : at + 28 + length]
            ip = packet[14:]
            total, header = int.from_bytes(ip[2:4], "big"), 4 * (ip[0] & 15)
            if packet[12:14] == b"\x08\x00" and ip[9] == 6:
                tcp = ip[header:total]
                found.append(tcp[4 * (tcp[12] >> 4) :])
        at += size
    return found


def test_a_stream_of_a_tim7xx(folder):
    raw = (folder / "tim7xx_lmdscandata_stream.bin").read_bytes()
    scans = scans_of(raw)
    assert len(scans) == 16
    first = scans[0]
    assert (first.version, first.device, first.serial, first.status) == (1, 1, 18480390, (0, 0))
    assert (first.telegrams, first.scans) == (44977, 44981)
    assert (first.since_start_us, first.sent_us) == (3014133219, 3014139433)
    assert (first.inputs, first.outputs, first.layer, first.encoders) == ((0, 0), (8, 0), 0, ())
    assert (first.scan_hz, first.measurement_hz) == (15.0, 16200.0)
    assert [channel.name for channel in first.channels] == ["DIST1", "RSSI1"]
    for channel in first.channels:
        assert (channel.scale, channel.offset, channel.start_deg, channel.bits) == (1.0, 0.0, -45.0, 16)
        assert channel.step_deg == pytest.approx(1 / 3) and len(channel.values) == 811
    ranges = first.channels[0].ranges()
    assert ranges[:3] == pytest.approx([0.626, 0.657, 0.616]) and np.isnan(ranges[3:11]).all()  # "implausible"
    assert ranges[-3:] == pytest.approx([0.178, 0.154, 0.176])
    assert first.channels[1].intensities()[:4].tolist() == [8177, 7678, 7840, 0]
    # nothing is measured where nothing comes back
    assert ((first.channels[1].values == 0) == np.isnan(ranges)).all()
    turns = np.diff([scan.since_start_us for scan in scans])
    assert turns == pytest.approx(np.full(15, 1e6 / 15), rel=0.002)
    assert {int(step) for step in np.diff([scan.scans for scan in scans])} == {1}


def test_the_stream_as_it_was_cut_on_the_network(folder):
    pieces = segments(folder / "sick_scan_xd_test.pcapng")
    raw = (folder / "tim7xx_lmdscandata_stream.bin").read_bytes()
    assert b"".join(pieces) == raw and len(pieces) > 16
    clock = Clock()
    host = ColaSession(clock=clock)
    host._commands.clear()
    host._found = True
    scans = [scan for piece in pieces for scan in host.receive(piece)]
    assert len(scans) == 16 and host.ready and host.pending == 0
    whole = scans_of(raw)
    for scan, data in zip(scans, whole, strict=True):
        np.testing.assert_array_equal(scan.ranges, data.channels[0].ranges())
    assert scans[0].device_time_s == pytest.approx(3014.133219)


def test_any_cut_and_any_lost_byte_costs_one_scan(folder):
    raw = (folder / "tim7xx_lmdscandata_stream.bin").read_bytes()[: 5 * 3374]
    for at in range(3, 3374, 97):
        parser = FrameParser()
        found = parser.feed(raw[: 3374 + at])
        found += parser.feed(raw[3374 + at + 1 :])
        found += parser.resume()
        assert len(found) == 4, at


def test_an_lms5xx_with_intensities_of_8_bits(folder):
    (scan,) = scans_of((folder / "lms_binary_LMDscandata_hardcoded.bin").read_bytes())
    assert (scan.version, scan.serial, scan.status) == (0, 18110550, (1, 0))
    assert (scan.telegrams, scan.scans, scan.scan_hz, scan.measurement_hz) == (54098, 54484, 25.0, 54000.0)
    distances, strength = scan.channels
    assert (distances.name, distances.bits, distances.start_deg) == ("DIST1", 16, -5.0)
    assert (strength.name, strength.bits) == ("RSSI1", 8)
    assert distances.step_deg == pytest.approx(1 / 6) and len(distances.values) == len(strength.values) == 1141
    assert distances.ranges()[:4] == pytest.approx([1.305, 1.299, 1.307, 1.299])
    assert distances.ranges()[-3:] == pytest.approx([0.626, 0.623, 0.624])
    assert strength.intensities()[[0, 1, -3, -2, -1]].tolist() == [254, 254, 211, 206, 208]


@pytest.mark.parametrize("name", ["20210113_tim871s_elephant.pcapng.json", "20210125-tim781s-scandata.pcapng.json"])
def test_whole_sessions_of_a_tim781s(folder, name):
    parser, scans, commands = FrameParser(), [], 0
    for payload in payloads(folder / name):
        for telegram in parser.feed(payload):
            reader = Reader(telegram)
            commands += reader.verb in m.ANSWERS
            if (reader.verb, reader.name) == ("sSN", "LMDscandata"):
                scans.append(ScanData.of(reader))
    assert parser.skipped == parser.pending == 0
    assert len(scans) == {"20210113": 150, "20210125": 140}[name[:8]] and commands > 40
    assert {scan.serial for scan in scans} == {18480390}
    assert {len(channel.values) for scan in scans for channel in scan.channels} == {811}
    seconds = np.array([scan.since_start_us for scan in scans]) / 1e6
    assert np.median(np.diff(seconds)) == pytest.approx(1 / 15, rel=0.002)


def first_words(telegram: bytes) -> bytes:
    return b" ".join(telegram[8:-1].split(b" ")[:2])


def test_our_commands_are_those_of_the_recorded_session(folder):
    sent = {raw for direction, raw in talk(folder / "tim781s_2021-01-13.frames.txt") if direction == ">"}
    ours = [m.login(m.PASSWORDS[1]), m.read("SCdevicestate"), m.read("FirmwareVersion"), m.content(True)]
    ours += [m.output_range(1 / 3, -45, 225), m.method("LMCstartmeas"), m.method("Run"), m.stream(True)]
    for command in ours:
        assert command.ask("B").encode() in sent, command


def test_a_session_with_the_recorded_device(folder):
    """It answers what it was asked then, and nothing to what it was not."""
    said = list(talk(folder / "tim781s_2021-01-13.frames.txt"))
    answers: dict[bytes, bytes] = {}
    for (_, question), (direction, answer) in itertools.pairwise(said):
        if direction == "<":
            answers.setdefault(question, answer)
    streamed = [raw for direction, raw in said if direction == "<" and first_words(raw) == b"sSN LMDscandata"]
    clock = Clock()
    host = ColaSession(clock=clock, passwords=(m.PASSWORDS[1],), field_deg=(-45, 225), resolution_deg=1 / 3)
    host.opened()
    scans = []
    for _ in range(400):
        clock.now += 0.05
        host.tick()
        for telegram in FrameParser().feed(host.output()):
            scans += host.receive(answers.get(telegram.encode(), b""))
            if telegram.encode() == m.stream(True).ask("B").encode():
                scans += host.receive(b"".join(streamed))
                assert len(scans) == len(streamed) == 10 and host.dialect == "B"
                assert scans[0].ranges[:5] == pytest.approx([0.767, 0.731, 0.692, 0.688, 0.685])
                assert scans[0].intensities[:3].tolist() == [8440, 8694, 8996]
                return
    raise AssertionError("it was never told to stream")


def test_a_session_in_text_of_a_radar(folder):
    """An RMS1xxx sends no scans; how it speaks is the same."""
    parser, said = FrameParser(), []
    for direction, raw in talk(folder / "rms1xxx_colaA_2022-10-18.frames.txt"):
        (telegram,) = parser.feed(raw)
        assert telegram.dialect == "A" and telegram.encode() == raw
        said.append((direction, Reader(telegram)))
    assert parser.skipped == 0
    told = {(one.verb, one.name): one for direction, one in said if direction == "<"}
    assert told["sRA", "DItype"].text() == "RMS2731C-636111" and told["sRA", "SerialNumber"].text() == "20439907"
    assert told["sRA", "FirmwareVersion"].text() == "1.5.1.115R"
    assert told["sRA", "LocationName"].text() == "SN 20439907"
    assert told["sAN", "SetAccessMode"].integer("B") == 1
    sent = {raw for direction, raw in talk(folder / "rms1xxx_colaA_2022-10-18.frames.txt") if direction == ">"}
    for command in (m.login(m.PASSWORDS[0]), m.read("SCdevicestate"), m.read("SerialNumber"), m.method("Run")):
        assert command.ask("A").encode() in sent
