"""Recorded reader bytes through the hand agent and a running server into the unknown-tag list, with their counts."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tms_client import cli

pytestmark = pytest.mark.realdata


def counts(town, room) -> dict[str, int]:
    return {one.tag: one.count for one in town.unknown_tags(room)}


def test_every_report_of_the_llrp_capture_counts(town, room, configure, shared_data: Path):
    capture = shared_data / "devices/llrp/ltk/LTK/Tests/dx101/dx101_a.bin"
    config = configure({"kind": "capture", "format": "llrp", "path": str(capture)})
    assert cli.main(["agent", "hand", "--config", str(config), "--once"]) == 0
    tree = ElementTree.parse(capture.with_suffix(".xml"))
    reads = [node.find("{*}EPC_96/{*}EPC").text for node in tree.iterfind(".//{*}TagReportData")]
    assert len(reads) == 130
    assert counts(town, room) == Counter(epc.upper() for epc in reads)


def test_every_whole_frame_of_the_tr3_stream_counts(town, room, configure, shared_data: Path):
    stream = shared_data / "devices/rfid_takaya_tr3/rdloop_stream.bin"
    config = configure({"kind": "capture", "format": "tr3", "path": str(stream)})
    assert cli.main(["agent", "hand", "--config", str(config), "--once"]) == 0
    assert counts(town, room) == {"E00401508747FFC8": 9}
