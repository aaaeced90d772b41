"""The agent's recorder: a disk that does not follow costs recorded scans, and that is said."""

from __future__ import annotations

import logging
import threading

import numpy as np

from tms_agents.devices.scans import Scan, Sweep
from tms_agents.floor.config import RecordingSection
from tms_agents.floor.recordings import recorder
from tms_agents.floor.recordings.formats import read_scans
from tms_agents.floor.recordings.recording import ScanWriter

SWEEP = Sweep(np.linspace(-2, 2, 20), 1e-4, 0.1, 0.02, 5.6)
POSE = (0.0, 0.0, 0.0)


def test_scans_that_a_slow_disk_leaves_out_are_said_once_a_minute_and_at_the_end(tmp_path, monkeypatch, caplog):
    goes_on = threading.Event()

    class Slow(ScanWriter):
        def add(self, *scan):
            goes_on.wait(10)
            super().add(*scan)

    monkeypatch.setattr(recorder, "_WAITING", 10)
    monkeypatch.setattr(recorder, "ScanWriter", Slow)
    caplog.set_level(logging.INFO)
    path = tmp_path / "x.scans"
    recording = recorder.Recorder(RecordingSection(path=path))
    for n in range(1300):
        recording.hear("a", POSE, 100 + 0.1 * n, Scan(SWEEP, np.ones(20)))
    goes_on.set()
    recording.close()
    kept = sum(map(len, read_scans(path)))
    said = [one.getMessage() for one in caplog.records]
    assert recording.left_out == 1300 - kept > 1200
    assert [one.partition(";")[0] for one in said[:-1]] == [f"recording {path}: the disk is too slow"] * 3
    assert said[-1] == f"recording {path}: {kept} scans, {1300 - kept} left out"


def test_all_is_well(tmp_path, caplog):
    caplog.set_level(logging.INFO)
    recording = recorder.Recorder(RecordingSection(path=tmp_path / "x.scans"))
    recording.hear("a", POSE, 100.0, Scan(SWEEP, np.ones(20)))
    recording.close()
    assert caplog.messages == [f"recording {tmp_path / 'x.scans'}: 1 scans, 0 left out"]
