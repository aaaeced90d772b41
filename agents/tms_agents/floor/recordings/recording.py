"""Our recording of scans: a file that is only ever appended to, whole up to its last second whatever happens.

``TMSSCAN1\\n``, then records: kind (1 byte), length and CRC-32 of the body (4 bytes each, little-endian), body. Kind S
describes a sensor (JSON) and gives it a number, kind B is a block of its scans: ranges in the sensor's unit as 16 bit
numbers, each scan as the difference to the one before, compressed. A torn record at the end is ignored by readers and
cut off by the next writer; readers may read while a writer writes.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.scans import Array, Scan, Sweep
from tms_agents.floor.recordings.recorded import Pose, Recorded

MAGIC = b"TMSSCAN1\n"
_HEAD = struct.Struct("<cII")
_BLOCK = struct.Struct("<HHIB")  # sensor, scans, beams, what is in it
_HAS_INTENSITIES, _HAS_DEVICE_TIME = 1, 2
_NO_ECHO, _ERROR = 0xFFFF, 0xFFFE
_MOST = 1 << 26
#: Of what is written between two times that the disk was told to be sure, so much may be torn by a power cut.
_TORN = 1 << 22
#: A block is written after so many seconds of scans or so many scans.
BLOCK_S, BLOCK_SCANS = 1.0, 100


class ScanWriter:
    """Appends to a recording; scans of the last second are lost with the power, all before are on the disk.

    Raises (also later): OSError where the disk refuses; ValueError where ``path`` is something else.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file: IO[bytes] = path.open("ab+")
        try:
            end = _whole(self._file)
            self._file.truncate(end)
            if end == 0:
                self._file.write(MAGIC)
            self._next = _sensors(self._file) if end else 0
        except BaseException:
            self._file.close()
            raise
        self._numbers: dict[str, tuple[Sweep, Pose, int, float]] = {}
        self._waiting: dict[str, list[tuple[float, Scan]]] = {}
        #: Scans taken so far.
        self.written = 0

    @property
    def size(self) -> int:
        """Bytes on the disk."""
        return self._file.seek(0, os.SEEK_END)

    def add(self, sensor: str, pose: Pose, t: float, scan: Scan) -> None:
        """A scan with the time of its first beam; written with others after about a second."""
        known = self._numbers.get(sensor)
        if known is None or known[0] is not scan.sweep or known[1] != pose:
            self._write(sensor)
            self._describe(sensor, pose, scan.sweep)
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
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        if not self._file.closed:
            try:
                self.flush()
            finally:
                self._file.close()

    def _describe(self, sensor: str, pose: Pose, sweep: Sweep) -> None:
        # Whole millimetres, as devices have them, unless the reach needs more room.
        reach = sweep.range_max_m if np.isfinite(sweep.range_max_m) else 65.0
        unit = 0.001 * max(1, int(np.ceil(reach * 1000 / (_ERROR - 1))))
        number, self._next = self._next, self._next + 1
        self._numbers[sensor] = (sweep, pose, number, unit)
        told = {
            "sensor": number,
            "name": sensor,
            "pose": list(pose),
            "unit_m": unit,
            "angles": [round(float(one), 9) for one in sweep.angles],
            "time_increment_s": sweep.time_increment_s,
            "period_s": sweep.period_s,
            "range_min_m": sweep.range_min_m,
            "range_max_m": sweep.range_max_m if np.isfinite(sweep.range_max_m) else None,
            "model": sweep.model,
        }
        self._record(b"S", zlib.compress(json.dumps(told).encode()))

    def _write(self, sensor: str) -> None:
        if scans := self._waiting.get(sensor):
            _, _, number, unit = self._numbers[sensor]
            self._waiting[sensor] = []
            self._record(b"B", _packed(number, unit, scans))

    def _record(self, kind: bytes, body: bytes) -> None:
        self._file.write(_HEAD.pack(kind, len(body), zlib.crc32(body)) + body)


def read_recording(path: Path) -> list[Recorded]:
    """All whole records, of a sensor as long as it sweeps and stands the same, also if it is described again.

    Raises:
        ValueError: it is no recording, or a record in the middle is damaged.
        OSError: the file cannot be read.
    """
    units: dict[int, float] = {}
    described: dict[int, str] = {}
    blocks: dict[str, list[tuple[Array, Array, Array | None]]] = {}
    with path.open("rb") as file:
        for kind, body in _records(file):
            if kind == b"S":
                told = json.loads(zlib.decompress(body))
                number = told.pop("sensor")
                units[number], described[number] = told["unit_m"], json.dumps(told)
            elif kind == b"B":
                number = _BLOCK.unpack_from(body)[0]
                blocks.setdefault(described[number], []).append(_unpacked(body, units[number]))
    return [_joined(json.loads(told), found) for told, found in blocks.items()]


def _joined(told: dict[str, Any], blocks: list[tuple[Array, Array, Array | None]]) -> Recorded:
    x, y, theta = told["pose"]
    bright = [one[2] for one in blocks if one[2] is not None]
    return Recorded(
        told["name"],
        _sweep(told),
        (x, y, theta),
        np.concatenate([one[0] for one in blocks]),
        np.concatenate([one[1] for one in blocks]),
        np.concatenate(bright) if len(bright) == len(blocks) else None,
    )


def _sweep(told: dict[str, Any]) -> Sweep:
    far = told["range_max_m"]
    return Sweep(
        np.array(told["angles"], dtype=np.float64),
        told["time_increment_s"],
        told["period_s"],
        told["range_min_m"],
        np.inf if far is None else far,
        told["model"],
    )


def _packed(number: int, unit: float, scans: list[tuple[float, Scan]]) -> bytes:
    ranges = np.array([scan.ranges for _, scan in scans])
    with np.errstate(invalid="ignore"):
        whole = np.clip(np.rint(np.nan_to_num(ranges, nan=0.0, posinf=0.0) / unit), 0, _ERROR - 1).astype(np.uint16)
    whole[np.isinf(ranges)] = _NO_ECHO
    whole[np.isnan(ranges)] = _ERROR
    parts = [np.array([t for t, _ in scans]).tobytes(), _shuffled(whole)]
    what = 0
    if all(scan.intensities is not None for _, scan in scans):
        what |= _HAS_INTENSITIES
        bright = np.array([scan.intensities for _, scan in scans], dtype=np.float64)
        parts.append(_shuffled(np.clip(np.rint(np.nan_to_num(bright)), 0, 0xFFFF).astype(np.uint16)))
    if all(scan.device_time_s is not None for _, scan in scans):
        what |= _HAS_DEVICE_TIME
        parts.append(np.array([scan.device_time_s for _, scan in scans], dtype=np.float64).tobytes())
    return _BLOCK.pack(number, *whole.shape, what) + zlib.compress(b"".join(parts), 6)


def _unpacked(body: bytes, unit: float) -> tuple[Array, Array, Array | None]:
    _, scans, beams, what = _BLOCK.unpack_from(body)
    data = zlib.decompress(body[_BLOCK.size :])
    t = np.frombuffer(data, np.float64, scans).copy()
    size = 2 * scans * beams
    whole = _unshuffled(data[8 * scans : 8 * scans + size], scans, beams)
    ranges = np.round(whole * unit, 6)
    ranges[whole == _NO_ECHO] = np.inf
    ranges[whole == _ERROR] = np.nan
    bright = None
    if what & _HAS_INTENSITIES:
        bright = _unshuffled(data[8 * scans + size : 8 * scans + 2 * size], scans, beams).astype(np.float64)
    return t, ranges, bright


def _shuffled(values: NDArray[np.uint16]) -> bytes:
    """Differences from scan to scan, low bytes before high ones: what compresses well."""
    steps = np.diff(values, axis=0, prepend=np.uint16(0))
    # Small steps of either sign get small numbers: 0, -1, 1, -2 ... as 0, 1, 2, 3.
    signed = steps.view(np.int16)
    folded = ((signed << 1) ^ (signed >> 15)).view(np.uint16)
    return (folded & 0xFF).astype(np.uint8).tobytes() + (folded >> 8).astype(np.uint8).tobytes()


def _unshuffled(data: bytes, scans: int, beams: int) -> NDArray[np.uint16]:
    low, high = np.frombuffer(data, np.uint8).reshape(2, scans, beams).astype(np.uint16)
    folded = low | (high << np.uint16(8))
    steps = (folded >> np.uint16(1)) ^ (np.uint16(0) - (folded & np.uint16(1)))
    values: NDArray[np.uint16] = np.cumsum(steps, axis=0, dtype=np.uint16)
    return values


def _records(file: IO[bytes]) -> Iterator[tuple[bytes, bytes]]:
    """Whole records from the start; a torn one at the end is no error."""
    if (start := file.read(len(MAGIC))) != MAGIC:
        if MAGIC.startswith(start):
            return
        raise ValueError("it is no recording of scans")
    while len(head := file.read(_HEAD.size)) == _HEAD.size:
        kind, length, check = _HEAD.unpack(head)
        body = file.read(min(length, _MOST))
        if kind not in (b"S", b"B") or len(body) < length or zlib.crc32(body) != check:
            at = file.tell() - len(body) - len(head)
            if file.seek(0, os.SEEK_END) - at > _TORN:
                raise ValueError(f"it is damaged after {at} bytes")
            return
        yield kind, body


def _whole(file: IO[bytes]) -> int:
    """Where the last whole record ends."""
    file.seek(0)
    end = 0
    for _ in _records(file):
        end = file.tell()
    if end == 0:
        file.seek(0)
        end = len(MAGIC) if file.read(len(MAGIC)) == MAGIC else 0
    return end


def _sensors(file: IO[bytes]) -> int:
    """How many sensors are described so far."""
    file.seek(0)
    count = sum(kind == b"S" for kind, _ in _records(file))
    file.seek(0, os.SEEK_END)
    return count
