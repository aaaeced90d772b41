"""Our recording of scans: a file that is only ever appended to, whole up to its last second whatever happens.

Its records are described in ``records``, the blocks of scans in ``blocks``. A torn record at the end is left out by
readers and cut off by the next writer; what is damaged before it stays and is skipped. Readers may read while a writer
writes.
"""

from __future__ import annotations

import contextlib
import json
import os
import zlib
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from tms_agents.devices.scans import Scan, Sweep
from tms_agents.floor.recordings.blocks import MOST_UNITS, packed
from tms_agents.floor.recordings.records import BLOCK, HEAD, MAGIC, Damage, records
from tms_agents.floor.settings import Pose

#: Of what is written between two times that the disk was told to be sure, so much may be torn by a power cut.
_TORN = 1 << 22
#: A block is written after so many seconds of scans or so many scans.
BLOCK_S, BLOCK_SCANS = 1.0, 100
#: A laser is described again after so long (s): if one description is damaged another one tells the same.
_AGAIN_S = 600.0


@dataclass(slots=True)
class _Described:
    """How a laser sweeps and where it stands, its number, what its ranges count in (m), the record, and when (s)."""

    sweep: Sweep
    pose: Pose
    number: int
    unit: float
    told: bytes
    at: float


class ScanWriter:
    """Appends to a recording; scans of the last second are lost with the power, all before are on the disk.

    ``upside_down``: the lasers whose scans come as of a laser with its top to the floor, told as seen from above.

    Raises (also later): OSError where the disk refuses; ValueError where ``path`` is something else.
    """

    def __init__(self, path: Path, upside_down: Collection[str] = ()) -> None:
        self.path, self._upside_down = path, upside_down
        #: What of the file that was there cannot be read.
        self.damage = Damage()
        self._file = path.open("ab+", buffering=0)
        try:
            self._next = _next_number(self._file, self.damage)
            #: Bytes on the disk.
            self.size = self.damage.whole
            if self.damage.tail <= _TORN:  # nothing that can be read comes after it
                self._file.truncate(self.size)
            else:
                self.size += self.damage.tail
        except BaseException:
            self._file.close()
            raise
        self._described: dict[str, _Described] = {}
        self._waiting: dict[str, list[tuple[float, Scan]]] = {}
        #: Scans taken so far, and those of them that are in the file.
        self.written = self.kept = 0

    def add(self, sensor: str, pose: Pose, t: float, scan: Scan) -> None:
        """A scan with the time of its first beam; written with others after about a second."""
        known = self._described.get(sensor)
        if known is None or known.sweep is not scan.sweep or known.pose != pose:
            self._write(sensor)
            self._describe(sensor, pose, t, scan.sweep)
        elif not 0.0 <= t - known.at <= _AGAIN_S:
            known.at = t
            self._record(b"S", known.told)
        if (before := self._waiting.get(sensor)) and _has(before[-1][1]) != _has(scan):
            self._write(sensor)  # the scans of a block are alike
        waiting = self._waiting.setdefault(sensor, [])
        waiting.append((t, scan))
        self.written += 1
        if len(waiting) >= BLOCK_SCANS or t - waiting[0][0] >= BLOCK_S:
            self._write(sensor)
            self.flush()

    def flush(self) -> None:
        """Everything onto the disk."""
        for sensor in self._waiting:
            self._write(sensor)
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """A file without anything in it is removed."""
        if not self._file.closed:
            try:
                self.flush()
            finally:
                self._file.close()
                if self.size == 0:
                    self.path.unlink(missing_ok=True)

    def _describe(self, sensor: str, pose: Pose, t: float, sweep: Sweep) -> None:
        # Whole millimetres, as devices have them, unless the reach needs more room.
        reach = sweep.range_max_m if np.isfinite(sweep.range_max_m) else 65.0
        unit = 0.001 * max(1, int(np.ceil(reach * 1000 / MOST_UNITS)))
        number, self._next = self._next, self._next + 1
        told = {"sensor": number, "name": sensor, "pose": list(pose), "unit_m": unit, **sweep.to_json()}
        told["upside_down"] = sensor in self._upside_down
        told["angles"] = [round(angle, 9) for angle in told["angles"]]
        known = _Described(sweep, pose, number, unit, zlib.compress(json.dumps(told).encode()), t)
        self._described[sensor] = known
        self._record(b"S", known.told)

    def _write(self, sensor: str) -> None:
        if scans := self._waiting.get(sensor):
            known = self._described[sensor]
            self._waiting[sensor] = []
            self._record(b"B", packed(known.number, known.unit, scans))
            self.kept += len(scans)

    def _record(self, kind: bytes, body: bytes) -> None:
        """All of it, or nothing where the disk is full."""
        data = memoryview(MAGIC * (self.size == 0) + HEAD.pack(kind, len(body), zlib.crc32(body)) + body)
        left = data
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError:
            with contextlib.suppress(OSError):
                self._file.truncate(self.size)
            raise
        self.size += len(data)


def _has(scan: Scan) -> tuple[bool, bool]:
    """Whether it comes with intensities, and with a time of the device."""
    return scan.intensities is not None, scan.device_time_s is not None


def _next_number(file: IO[bytes], damage: Damage) -> int:
    """A number that no sensor has had in this file, nor one whose description is damaged."""
    most = -1
    for record in records(file, damage):
        number = (
            BLOCK.unpack_from(record.body)[0]
            if record.kind == b"B"
            else json.loads(zlib.decompress(record.body))["sensor"]
        )
        most = max(most, number)
    return most + 1
