"""Bytes of real LLRP readers against what others decoded from them."""

from __future__ import annotations

import base64
import json
import xml.etree.ElementTree as ElementTree
from datetime import UTC, datetime, timedelta
from pathlib import Path

import llrp_golden
import pytest

from tms_agents.devices.llrp import messages
from tms_agents.devices.llrp.codec import FrameParser, decode_body, encode

pytestmark = pytest.mark.realdata

LTK = "devices/llrp/ltk/LTK/Tests"
JAVA = "devices/llrp/ltk/LTK/LTKJava/src/test/resources"
EDGEX = "devices/llrp/edgex_testdata/pkg/llrp/testdata"
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@pytest.mark.parametrize(
    ("name", "count", "tags", "values"),
    [("dx101_a", 934, 130, 5084), ("dx101_b", 24, 132, 726), ("dx101_e", 750, 237, 22757)],
)
def test_a_capture_equals_its_golden_xml(shared_data: Path, name: str, count: int, tags: int, values: int):
    """Every message by type and id, and every field of every parameter of it."""
    raw = (shared_data / LTK / "dx101" / f"{name}.bin").read_bytes()
    golden = list(ElementTree.parse(shared_data / LTK / "dx101" / f"{name}.xml").getroot())
    parser = FrameParser()
    decoded = [message for i in range(0, len(raw), 7) for message in parser.feed(raw[i : i + 7])]
    assert (len(decoded), parser.skipped, parser.pending) == (count, 0, 0)
    assert [(message.name, message.id) for message in decoded] == [
        (llrp_golden.local(element), int(element.attrib["MessageID"])) for element in golden
    ]
    compared = 0
    for message, element in zip(decoded, golden, strict=True):
        expected = llrp_golden.of_xml(element)
        assert llrp_golden.of_message(message) == expected, message
        compared += sum(map(len, expected.values()))
    assert compared == values
    assert sum(len(messages.tag_reads(message)) for message in decoded) == tags
    assert b"".join(map(encode, decoded)) == raw


def test_single_messages_equal_their_xml(shared_data: Path):
    files = sorted((shared_data / JAVA).glob("*.bin"))
    assert len(files) == 13
    for file in files:
        (message,) = FrameParser().feed(file.read_bytes())
        ours = llrp_golden.of_message(message)
        theirs = llrp_golden.of_xml(ElementTree.parse(file.with_suffix(".xml")).getroot())
        if file.stem == "ADD_ROSPEC2":  # its writer had the two bits of the session the wrong way round
            session = next(path for path in ours if path[-1] == "Session")
            assert (ours.pop(session), theirs.pop(session)) == ([2, 2], [1, 1])
        assert ours == theirs, file.name
        assert encode(message) == file.read_bytes()


def test_the_reads_of_a_capture(shared_data: Path):
    """``TagRead`` carries what the golden report says: tag, antenna, RSSI, both times, count."""
    raw = (shared_data / LTK / "dx101/dx101_a.bin").read_bytes()
    reads = [read for message in FrameParser().feed(raw) for read in messages.tag_reads(message)]
    golden = [
        element
        for message in ElementTree.parse(shared_data / LTK / "dx101/dx101_a.xml").getroot()
        for element in message
        if llrp_golden.local(element) == "TagReportData"
    ]

    def leaf(element: ElementTree.Element, parameter: str) -> str:
        return next(child[0].text or "" for child in element if llrp_golden.local(child) == parameter)

    assert [(read.tag, read.antenna, read.rssi_dbm, read.first_seen, read.last_seen, read.count) for read in reads] == [
        (
            leaf(one, "EPC_96"),
            int(leaf(one, "AntennaID")),
            float(leaf(one, "PeakRSSI")),
            datetime.fromisoformat(leaf(one, "FirstSeenTimestampUTC")),
            datetime.fromisoformat(leaf(one, "LastSeenTimestampUTC")),
            int(leaf(one, "TagSeenCount")),
        )
        for one in golden
    ]
    assert (len(reads), len({read.tag for read in reads})) == (130, 65)


EDGEX_KINDS = {
    "CloseConnectionResponse": 4,
    "GetReaderCapabilitiesResponse": 11,
    "GetReaderConfigResponse": 12,
    "GetROSpecsResponse": 36,
    "GetAccessSpecsResponse": 54,
    "ROAccessReport": 61,
    "ReaderEventNotification": 63,
}


def test_every_edgex_body_equals_its_json(shared_data: Path):
    """Recorded from an Impinj reader; every value of the JSON, and none that it has not."""
    files = sorted((shared_data / EDGEX).rglob("*.bytes"))
    assert len(files) == 15
    for file in files:
        body = file.read_bytes()
        message = decode_body(EDGEX_KINDS[file.name.partition("-")[0]], body)
        assert encode(message)[10:] == body
        expected = llrp_golden.of_edgex(json.loads(file.with_suffix(".json").read_text()))
        assert llrp_golden.of_message(message) == expected, file.name


@pytest.mark.parametrize("number", range(1, 10))
def test_edgex_report_bodies_as_reads(shared_data: Path, number: int):
    stem = shared_data / EDGEX / "roAccessReports" / f"ROAccessReport-{number:03d}"
    (read,) = messages.tag_reads(decode_body(61, stem.with_suffix(".bytes").read_bytes()))
    (expected,) = json.loads(stem.with_suffix(".json").read_text())["TagReportData"]
    assert read.tag == base64.b64decode(expected["EPC96"]["EPC"]).hex().upper()
    assert (read.antenna, read.rssi_dbm) == (expected["AntennaID"], expected["PeakRSSI"])
    assert read.first_seen == EPOCH + timedelta(microseconds=expected["FirstSeenUTC"])


def test_capabilities_of_another_reader(shared_data: Path):
    raw = (shared_data / "devices/llrp/sllurp_caps.dat").read_bytes()
    (message,) = FrameParser().feed(raw)
    general = message.find("GeneralDeviceCapabilities")
    assert general is not None and general.text("ReaderFirmwareVersion") == "4.8.3.240"
    assert general.number("ModelName") == 2001001 and encode(message) == raw


def test_in_a_real_capture_the_report_comes_before_the_end_of_its_aispec(shared_data: Path):
    """The order on which rounds rest: what an AISpec saw is reported before the event that ends it."""
    raw = (shared_data / LTK / "dx101/dx101_a.bin").read_bytes()
    order = []
    for message in FrameParser().feed(raw):
        event = message.find("ReaderEventNotificationData")
        if message.name == "RO_ACCESS_REPORT" or (event and event.find("AISpecEvent")):
            order.append("report" if event is None else "end")
    assert order == ["report", "end"] * 3
