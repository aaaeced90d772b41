"""Bytes of real Hokuyo sensors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from device_conversation import Clock

from tms_agents.devices.scip import (
    MODELS,
    Parameters,
    ReplyParser,
    ScipDevice,
    measurement,
    ranges,
    read_capture,
)

pytestmark = pytest.mark.realdata

FOLDER = "devices/scip"
CAPTURES = {
    "urg04lx_gd_682_b": "URG-04LX",
    "urg04lx_gd_682_c": "URG-04LX",
    "urg04lx_ms_682": "URG-04LX",
    "urg04lxug01_gd_682": "URG-04LX-UG01",
    "utm30lx_md_cluster4": "UTM-30LX",
}


def capture(shared_data: Path, name: str) -> bytes:
    return (shared_data / FOLDER / f"{name}.txt").read_bytes()


def expected(shared_data: Path, name: str) -> tuple[int, list[int]]:
    """Time stamp (ms) and distances (mm)."""
    head, *values = (shared_data / FOLDER / f"{name}.expected.csv").read_text().split("\n", 1)
    return int(head.split("timestamp_ms=")[1].split()[0]), [int(value) for value in values[0].split()]


def transcripts(shared_data: Path) -> list[bytes]:
    """What follows each command, without the notes."""
    lines = (shared_data / FOLDER / "transcripts_info.txt").read_bytes().split(b"\n")
    text = b"\n".join(line for line in lines if not line.startswith(b"#"))
    return [block.strip(b"\n") + b"\n\n" for block in text.split(b"\n\n") if block.strip()]


def test_every_capture_is_known(shared_data: Path):
    assert {path.stem for path in (shared_data / FOLDER).glob("*.txt")} == {*CAPTURES, "transcripts_info"}


@pytest.mark.parametrize("name", CAPTURES)
@pytest.mark.parametrize("piece", [1, 7, 66, 100_000])
def test_captures_have_the_expected_values(shared_data: Path, name: str, piece: int):
    raw, parser = capture(shared_data, name) + b"\n\n", ReplyParser()
    replies = [reply for at in range(0, len(raw), piece) for reply in parser.feed(raw[at : at + piece])]
    (found,) = [one for one in map(measurement, replies) if one is not None]
    assert (found.stamp_ms, found.distances.tolist()) == expected(shared_data, name)
    assert parser.skipped == 0


@pytest.mark.parametrize("name", CAPTURES)
def test_codes_of_real_scans_are_no_ranges(shared_data: Path, name: str):
    (found,) = read_capture(capture(shared_data, name))
    _, raw = expected(shared_data, name)
    p = MODELS[CAPTURES[name]].parameters
    metres = ranges(found, p)
    measured = np.isfinite(metres)
    assert metres[measured].min() >= p.dmin / 1000 and metres[measured].max() <= p.dmax / 1000
    np.testing.assert_allclose(metres[measured] * 1000, np.array(raw)[measured])
    short = found.request.width == 2
    far = [value == MODELS[CAPTURES[name]].coding.far or (short and value == 4095) for value in raw]
    assert np.isinf(metres).tolist() == far
    assert np.isnan(metres).tolist() == [value < p.dmin and not at for value, at in zip(raw, far, strict=True)]


def test_every_line_of_the_transcripts_has_a_right_sum(shared_data: Path):
    parser = ReplyParser()
    replies = [reply for block in transcripts(shared_data) for reply in parser.feed(block)]
    assert [(reply.command, reply.status, len(reply.lines)) for reply in replies] == [
        ("VV", "00", 5),
        ("BM", "02", 0),
        ("VV", "00", 5),
        ("PP", "00", 8),
        ("II", "00", 7),
        ("SCIP2.0", "0E", 0),
    ]
    assert parser.skipped == 0
    assert Parameters.parse(replies[3].lines) == MODELS["URG-04LX"].parameters


def test_the_emulated_sensors_give_the_recorded_answers(shared_data: Path):
    clock = Clock()
    devices = [ScipDevice(lambda: (np.ones(682), None), name, clock=clock) for name in ("URG-04LX-UG01", "URG-04LX")]
    for device in devices:
        device.old = False
    first, second = devices
    second.clock_ahead_ms = 0x081615
    simple, laser_on, *classic = transcripts(shared_data)
    assert first.receive(b"VV\n") == simple
    first.receive(b"BM\n")
    assert first.receive(b"BM\n") == laser_on
    for command, answer in zip((b"VV\n", b"PP\n", b"II\n", b"SCIP2.0\n"), classic, strict=True):
        assert second.receive(command) == answer


def test_a_capture_cut_anywhere_gives_nothing_and_hides_nothing(shared_data: Path):
    raw = capture(shared_data, "urg04lxug01_gd_682").rstrip(b"\n") + b"\n\n"
    (whole,) = read_capture(raw)
    for cut in range(1, len(raw) - 2, 13):
        found = read_capture(raw[:cut] + raw)
        assert [one.distances.tolist() for one in found] == [whole.distances.tolist()]
        assert read_capture(raw[:cut]) == []
