"""Records what the lasers of an agent deliver, beside its work: a slow or full disk costs the floor no scan."""

from __future__ import annotations

import logging
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor

from tms_agents.devices.scans import Scan
from tms_agents.floor.config import RecordingSection
from tms_agents.floor.recordings.recording import ScanWriter
from tms_agents.floor.settings import Pose

log = logging.getLogger(__name__)
#: Scans that wait for the disk; more are left out.
_WAITING = 2000
_RETRY_S = 60.0
#: That scans are left out is said so often.
_SAY_S = 60.0


class Recorder:
    """Trouble with the disk is said once; a minute later it is tried again."""

    def __init__(self, section: RecordingSection, upside_down: Collection[str] = ()) -> None:
        self._upside_down = upside_down
        self._path, self._most_bytes = section.path, int(section.max_mb * 1e6)
        self._thread = ThreadPoolExecutor(1, "recorder")
        self._waiting = 0
        self._writer: ScanWriter | None = None
        self._off_until = float("-inf")
        self._say_at = float("-inf")
        self.left_out = self._recorded = 0

    def hear(self, laser: str, pose: Pose, t: float, scan: Scan) -> None:
        """To be called from one thread; returns at once."""
        if self._waiting >= _WAITING:
            self.left_out += 1
            if t >= self._say_at:
                self._say_at = t + _SAY_S
                log.warning("recording %s: the disk is too slow; %d scans left out so far", self._path, self.left_out)
            return
        self._waiting += 1
        self._thread.submit(self._write, laser, pose, t, scan)

    def close(self) -> None:
        """After everything is on the disk."""
        self._thread.submit(self._end)
        self._thread.shutdown()
        level = logging.WARNING if self.left_out else logging.INFO
        log.log(level, "recording %s: %d scans, %d left out", self._path, self._recorded, self.left_out)

    def _write(self, laser: str, pose: Pose, t: float, scan: Scan) -> None:
        self._waiting -= 1
        if t < self._off_until:
            self.left_out += 1
            return
        try:
            if self._writer is not None and self._writer.size > self._most_bytes:
                self._writer.close()
                self._writer = None
                self._path.replace(self._path.with_name(self._path.name + ".old"))
            if self._writer is None:
                self._writer = ScanWriter(self._path, self._upside_down)
                if words := self._writer.damage.in_words():
                    log.warning("recording %s: %s", self._path, words)
            self._writer.add(laser, pose, t, scan)
            self._recorded += 1
        except (OSError, ValueError) as error:
            log.warning("recording %s: %s; nothing is recorded for a minute", self._path, error)
            self._off_until = t + _RETRY_S
            self._end()

    def _end(self) -> None:
        writer, self._writer = self._writer, None
        try:
            if writer is not None:
                writer.close()
        except OSError as error:
            log.warning("recording %s: %s", self._path, error)
