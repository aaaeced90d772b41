"""Bytes of real LLRP readers against what others decoded from them."""

from __future__ import annotations

import base64
import json
import xml.etree.ElementTree as ElementTree
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from tms_agents.devices.llrp import messages
from tms_agents.devices.llrp.codec import FrameParser, Parameter, decode_body, encode
from tms_agents.devices.llrp.tables import PARAMETER_TYPES

pytestmark = pytest.mark.realdata

LTK = "devices/llrp/ltk/LTK/Tests"
EDGEX = "devices/llrp/edgex_testdata/pkg/llrp/testdata"
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
#: The golden XML writes these values in words.
WORDS = {
    "true": 1,
    "false": 0,
    "M_Success": 0,
    "Success": 0,
    "Start_Of_ROSpec": 0,
    "End_Of_ROSpec": 1,
    "Preemption_Of_ROSpec": 2,
    "End_Of_AISpec": 0,
    "Start_Of_RFSurvey": 0,
    "End_Of_RFSurvey": 1,
    "Antenna_Disconnected": 0,
    "Antenna_Connected": 1,
    "Failed_A_Reader_Initiated_Connection_Already_Exists": 1,
    "Failed_A_Client_Initiated_Connection_Already_Exists": 2,
    "Failed_Reason_Other_Than_A_Connection_Already_Exists": 3,
    "Another_Connection_Attempted": 4,
}


@pytest.mark.parametrize(
    ("name", "count", "tags"), [("dx101_a", 934, 130), ("dx101_b", 24, 132), ("dx101_e", 750, 237)]
)
def test_a_capture_equals_its_golden_xml(shared_data: Path, name: str, count: int, tags: int):
    """Every message by type and id; every tag report and reader event field by field."""
    raw = (shared_data / LTK / "dx101" / f"{name}.bin").read_bytes()
    golden = golden_messages(shared_data / LTK / "dx101" / f"{name}.xml")
    parser = FrameParser()
    decoded = [message for i in range(0, len(raw), 7) for message in parser.feed(raw[i : i + 7])]
    assert (len(decoded), parser.skipped, parser.pending) == (count, 0, 0)
    assert [(message.name, message.id) for message in decoded] == [
        (local(element), int(element.attrib["MessageID"])) for element in golden
    ]
    assert b"".join(map(encode, decoded)) == raw
    compared = sum(
        same(message, element)
        for message, element in zip(decoded, golden, strict=True)
        if message.name in ("RO_ACCESS_REPORT", "READER_EVENT_NOTIFICATION")
    )
    assert sum(len(messages.tag_reads(message)) for message in decoded) == tags
    reports = [element for message in golden for element in message.iter() if local(element) == "TagReportData"]
    assert len(reports) == tags and compared >= 5 * tags


def test_the_reads_of_a_capture(shared_data: Path):
    """``TagRead`` carries what the golden report says: tag, antenna, RSSI, both times, count."""
    raw = (shared_data / LTK / "dx101/dx101_a.bin").read_bytes()
    reads = [read for message in FrameParser().feed(raw) for read in messages.tag_reads(message)]
    golden = [
        element
        for message in golden_messages(shared_data / LTK / "dx101/dx101_a.xml")
        for element in message
        if local(element) == "TagReportData"
    ]

    def leaf(element: ElementTree.Element, parameter: str) -> str:
        return next(child[0].text or "" for child in element if local(child) == parameter)

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


@pytest.mark.parametrize("number", range(1, 10))
def test_edgex_report_bodies_equal_their_json(shared_data: Path, number: int):
    stem = shared_data / EDGEX / "roAccessReports" / f"ROAccessReport-{number:03d}"
    message = decode_body(61, stem.with_suffix(".bytes").read_bytes())
    (expected,) = json.loads(stem.with_suffix(".json").read_text())["TagReportData"]
    (read,) = messages.tag_reads(message)
    assert read.tag == base64.b64decode(expected["EPC96"]["EPC"]).hex().upper()
    assert (read.antenna, read.rssi_dbm) == (expected["AntennaID"], expected["PeakRSSI"])
    assert read.first_seen == EPOCH + timedelta(microseconds=expected["FirstSeenUTC"])
    given = {name for name, value in expected.items() if value is not None and name != "EPCData"}
    assert given == {"EPC96", "AntennaID", "PeakRSSI", "FirstSeenUTC"} and len(message.children[0].children) == 4


def test_edgex_event_and_capabilities(shared_data: Path):
    event = decode_body(63, (shared_data / EDGEX / "ReaderEventNotification-000.bytes").read_bytes())
    expected = json.loads((shared_data / EDGEX / "ReaderEventNotification-000.json").read_text())
    data = event.children[0]
    stamp = data.find("UTCTimestamp")
    assert stamp is not None
    assert stamp.number("Microseconds") == expected["ReaderEventNotificationData"]["UTCTimestamp"]
    assert data.find("ConnectionCloseEvent") is not None

    body = (shared_data / EDGEX / "GetReaderCapabilitiesResponse-000.bytes").read_bytes()
    general = json.loads((shared_data / EDGEX / "GetReaderCapabilitiesResponse-000.json").read_text())
    general = general["GeneralDeviceCapabilities"]
    ours = decode_body(11, body).find("GeneralDeviceCapabilities")
    assert ours is not None
    assert ours.number("MaxNumberOfAntennaSupported") == general["MaxSupportedAntennas"]
    assert ours.number("DeviceManufacturerName") == general["DeviceManufacturer"]
    assert ours.text("ReaderFirmwareVersion") == general["FirmwareVersion"]
    assert encode(decode_body(11, body))[10:] == body


def golden_messages(path: Path) -> list[ElementTree.Element]:
    return list(ElementTree.parse(path).getroot())


def local(element: ElementTree.Element) -> str:
    return element.tag.partition("}")[2] or element.tag


def same(parameter: Parameter, element: ElementTree.Element) -> int:
    """Assert that the decoded parameter equals the golden one; returns how many values were compared.

    Parts the tables do not describe (results of access operations) stay bytes and are passed over.
    """
    mine = [child for child in parameter.children if not child.name.startswith("TLV")]
    theirs = [child for child in element if local(child) in PARAMETER_TYPES and local(child) not in parameter.values]
    assert [child.name for child in mine] == [local(one) for one in theirs], parameter.name
    compared = sum(same(child, one) for child, one in zip(mine, theirs, strict=True))
    for leaf in element:
        name, text = local(leaf), (leaf.text or "").strip()
        if name not in parameter.values:
            continue
        value = parameter.values[name]
        compared += 1
        if name in ("EPC", "Data"):
            assert parameter.hex(name) == text.upper(), parameter.name
        elif name == "Microseconds" and "T" in text:
            assert EPOCH + timedelta(microseconds=parameter.number(name)) == datetime.fromisoformat(text)
        elif name == "GPIEvent":
            assert parameter.number(name) >> 7 == WORDS[text]
        elif text in WORDS:
            assert value == WORDS[text], (parameter.name, name)
        else:
            assert str(value) == text, (parameter.name, name)
    return compared
