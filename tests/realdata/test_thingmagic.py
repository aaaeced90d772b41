"""Bytes of a real ThingMagic M5e: every frame decodes exactly, and the emulated module answers the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from tms_agents.devices.thingmagic import messages as m
from tms_agents.devices.thingmagic.codec import CommandParser, ReplyParser
from tms_agents.devices.thingmagic.emulator import ThingMagicDevice

pytestmark = pytest.mark.realdata

TAG = "E200322FE20DF9311328B7E3"


@pytest.fixture
def exchanges(shared_data: Path) -> list[tuple[str, bytes, bytes]]:
    """What the comment says, what the host sent, what the reader answered."""
    found, comment, sent = [], "", b""
    for line in (shared_data / "devices/rfid_thingmagic/m5e_transcript.txt").read_text().splitlines():
        if line.startswith("#"):
            comment = line
        elif line.startswith(">"):
            sent = bytes.fromhex(line[1:])
        elif line.startswith("<"):
            found.append((comment, sent, bytes.fromhex(line[1:])))
    return found


@pytest.mark.parametrize("piece", [1, 3, 1000])
def test_every_frame_has_a_right_crc_and_encodes_to_the_same_bytes(exchanges, piece):
    assert len(exchanges) == 15
    for _, sent, answered in exchanges:
        for raw, parser in ((sent, CommandParser()), (answered, ReplyParser())):
            frames = [frame for i in range(0, len(raw), piece) for frame in parser.feed(raw[i : i + piece])]
            assert len(frames) == 1 and frames[0].encode() == raw and parser.skipped == parser.pending == 0


def test_what_the_module_said(exchanges):
    answers = {}
    for comment, sent, answered in exchanges:
        (reply,) = ReplyParser().feed(answered)
        answers.setdefault(comment, []).append((sent, reply))

    def said(words: str):
        return next(found for comment, found in answers.items() if words in comment)

    ((sent, reply),) = said("tag present")
    assert sent == m.read_single(1000).encode() and m.single_tag(reply) == TAG
    ((_, reply),) = said("no tag")
    assert m.meaning(reply.status) == "status 0400 no tag found"
    assert said("set region")[0][0] == m.set_region("EU").encode()
    assert said("set tag protocol")[0][0] == m.set_protocol().encode()
    assert said("set read tx power")[0][0] == m.set_read_power(10).encode()
    assert said("boot firmware")[0][0] == m.boot().encode()


def test_the_emulated_module_gives_the_recorded_answers(exchanges):
    """Byte for byte, from the boot loader on, with a tag where the transcript has one."""
    device = ThingMagicDevice()
    device.connected = {1}
    for comment, sent, answered in exchanges:
        if "tag present" in comment:
            device.see(TAG)
        elif "no tag" in comment:
            device.lose(TAG)
        assert device.receive(sent) == answered, comment
