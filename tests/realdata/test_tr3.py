"""Bytes of a real Takaya TR3."""

from __future__ import annotations

from pathlib import Path

import pytest

from tms_agents.devices.tags import TagRead
from tms_agents.devices.tr3.codec import FrameParser
from tms_agents.devices.tr3.emulator import Tr3Device
from tms_agents.devices.tr3.session import Tr3Session

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


def test_every_beginning_and_every_end_of_the_stream_gives_its_whole_frames(shared_data: Path):
    """Wherever the stream is cut: each frame that is whole is found, and nothing else."""
    raw = (shared_data / FOLDER / "rdloop_stream.bin").read_bytes()
    whole = bytes.fromhex("02004C18C8FF4787500104E0")
    starts = [at for at in range(len(raw)) if raw.startswith(whole, at)]
    for cut in range(len(raw) + 1):
        head, tail, session = FrameParser(), FrameParser(), Tr3Session(mode="rdloop")
        before = sum(at + 31 <= cut for at in starts)
        after = sum(at >= cut and at + 31 <= len(raw) for at in starts)
        assert [frame.uid() for frame in head.feed(raw[:cut])] == ["E00401508747FFC8"] * before
        assert [frame.uid() for frame in tail.feed(raw[cut:])] == ["E00401508747FFC8"] * after
        # in two pieces: the frame that lies across the cut as well
        reads = [*session.receive(raw[:cut]), *session.receive(raw[cut:])]
        assert reads == [TagRead(tag="E00401508747FFC8")] * sum(at + 31 <= len(raw) for at in starts)


def test_the_emulated_reader_gives_the_recorded_answers(shared_data: Path):
    device, host = Tr3Device(), b""
    answered = []
    for line in (shared_data / FOLDER / "tr3_transcript.txt").read_text().splitlines():
        if line.startswith(">"):
            host = bytes.fromhex(line[1:])
        elif line.startswith("<"):
            answered.append(device.receive(host) == bytes.fromhex(line[1:]))
    assert answered == [True] * 3


def test_every_frame_of_the_transcript_has_a_right_sum(shared_data: Path):
    lines = (shared_data / FOLDER / "tr3_transcript.txt").read_text().splitlines()
    frames = [bytes.fromhex(line[1:]) for line in lines if line[:1] in "<>"]
    assert len(frames) >= 7
    for raw in frames:
        parser = FrameParser()
        (frame,) = parser.feed(raw)
        assert frame.encode() == raw and parser.skipped == 0
