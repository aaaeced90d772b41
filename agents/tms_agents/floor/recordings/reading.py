"""Recordings read lazily: a file is gone through once for what is whole in it; scans are decoded as they are wanted."""

from __future__ import annotations

import json
import os
import weakref
import zlib
from bisect import bisect_right
from pathlib import Path
from typing import Any

import numpy as np

from tms_agents.devices.scans import Array, Sweep
from tms_agents.floor.recordings.blocks import times, unpacked
from tms_agents.floor.recordings.recorded import Recorded, Row
from tms_agents.floor.recordings.records import BLOCK, Damage, records
from tms_client.cli import CommandError


def read_recording(path: Path, damage: Damage) -> list[Recorded]:
    """All whole records, of a sensor as long as it sweeps and stands the same, also if it is described again.

    Raises:
        ValueError: it is no recording.
        OSError: the file cannot be read.
    """
    source = _Source(path)
    sensors: dict[str, _Blocks] = {}
    by_number: dict[int, _Blocks] = {}
    with open(source.number, "rb", closefd=False) as file:
        for record in records(file, damage):
            if record.kind == b"S":
                told = json.loads(zlib.decompress(record.body))
                number = told.pop("sensor")
                by_number[number] = sensors.setdefault(json.dumps(told), _Blocks(source, told))
                continue
            number, scans, beams, _ = BLOCK.unpack_from(record.body)
            if number in by_number and by_number[number].beams == beams:
                by_number[number].add(record.at, record.body)
            else:
                damage.undescribed += scans
    return [one.recorded() for one in sensors.values() if len(one)]


class _Source:
    """A file that stays open for as long as anybody wants scans of it, also if another one gets its name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.number = os.open(path, os.O_RDONLY)
        weakref.finalize(self, os.close, self.number)

    def read(self, at: int, length: int) -> bytes:
        try:
            return os.pread(self.number, length, at)
        except OSError as error:
            raise CommandError(f"{self.path}: {error.strerror}") from error


class _Blocks:
    """The scans of one sensor; of its blocks the one looked at last is kept decoded."""

    def __init__(self, source: _Source, told: dict[str, Any]) -> None:
        self._source, self._told = source, told
        self.beams = len(told["angles"])
        #: Where each block is, how long it is, and its check sum.
        self._places: list[tuple[int, int, int]] = []
        #: The number of the first scan of each block, and of the one after the last.
        self._firsts = [0]
        self._times: list[Array] = []
        self._decoded: tuple[int, Array, Array | None] | None = None

    def add(self, at: int, body: bytes) -> None:
        self._times.append(times(body))
        self._places.append((at, len(body), zlib.crc32(body)))
        self._firsts.append(self._firsts[-1] + len(self._times[-1]))

    def recorded(self) -> Recorded:
        x, y, theta = self._told["pose"]
        t = np.concatenate(self._times)
        self._times.clear()
        return Recorded(self._told["name"], _sweep(self._told), (x, y, theta), t, self)

    def __len__(self) -> int:
        return self._firsts[-1]

    def __getitem__(self, n: int, /) -> Row:
        if not 0 <= n < len(self):
            raise IndexError(n)
        block = bisect_right(self._firsts, n) - 1
        if self._decoded is None or self._decoded[0] != block:
            self._decoded = (block, *self._unpacked(block))
        _, ranges, bright = self._decoded
        row = n - self._firsts[block]
        return ranges[row], None if bright is None else bright[row]

    def _unpacked(self, block: int) -> tuple[Array, Array | None]:
        at, length, check = self._places[block]
        body = self._source.read(at, length)
        if zlib.crc32(body) != check:
            raise CommandError(f"{self._source.path}: it changed while it was read")
        return unpacked(body, self._told["unit_m"])


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
