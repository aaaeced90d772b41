"""Agents as processes end in order: each is told once, and has the time it needs."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from tms_agents.simulation import processes
from tms_agents.simulation.service import stop

#: Ends 0.3 s after it was told to, with 40 and how often that was as its status.
_COUNTS = """
import signal, sys, time
told = []
signal.signal(signal.SIGTERM, lambda *_: told.append(1))
print("ready", flush=True)
while not told:
    time.sleep(0.01)
time.sleep(0.3)
sys.exit(40 + len(told))
"""


def test_all_are_told_to_end_at_once_and_each_of_them_once() -> None:
    both = [subprocess.Popen([sys.executable, "-c", _COUNTS], stdout=subprocess.PIPE) for _ in range(2)]
    for one in both:
        assert one.stdout is not None and one.stdout.readline() == b"ready\n"
    stop(*both)
    stop(*both)
    for one in both:
        assert one.stdout is not None
        one.stdout.close()
    assert [one.returncode for one in both] == [41, 41]


def test_agents_are_told_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started, begin = [], subprocess.Popen

    def counting(_: list[str], **options: object) -> subprocess.Popen[bytes]:
        started.append(begin([sys.executable, "-c", _COUNTS], **options))  # type: ignore[call-overload]
        return started[-1]

    monkeypatch.setattr(processes.subprocess, "Popen", counting)
    configs = {name: tmp_path / f"{name}.toml" for name in ("a", "b")}
    with processes.running_agents(configs, "http://127.0.0.1:9", None) as agents:
        while not all(agents.said(name, "ready") for name in configs):
            time.sleep(0.01)
        agents.require_alive()
    assert [one.returncode for one in started] == [41, 41]
