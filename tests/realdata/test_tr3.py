"""Bytes of a real Takaya TR3."""

from __future__ import annotations

from pathlib import Path

import pytest

from tms_agents.devices.tr3.codec import FrameParser

pytestmark = pytest.mark.realdata

FOLDER = "devices/rfid_takaya_tr3"


@pytest.mark.parametrize("piece", [1, 5, 31, 1000])
def test_a_stream_cut_in_the_middle_of_frames(shared_data: Path, piece: int):
    raw = (shared_data / FOLDER / "rdloop_stream.bin").read_bytes()
    parser = FrameParser()
    frames = [frame for i in range(0, len(raw), piece) for frame in parser.feed(raw[i : i + piece])]
    assert {frame.uid() for frame in frames} == {"E00401508747FFC8"}
    # 331 bytes: the tail of one frame, whole frames of 31 bytes, the head of another
    assert len(frames) == raw.count(bytes.fromhex("03DF0D")) - 1
    assert parser.skipped + parser.pending + 31 * len(frames) == len(raw)


def test_every_frame_of_the_transcript_has_a_right_sum(shared_data: Path):
    lines = (shared_data / FOLDER / "tr3_transcript.txt").read_text().splitlines()
    frames = [bytes.fromhex(line[1:]) for line in lines if line[:1] in "<>"]
    assert len(frames) >= 7
    for raw in frames:
        parser = FrameParser()
        (frame,) = parser.feed(raw)
        assert frame.encode() == raw and parser.skipped == 0
