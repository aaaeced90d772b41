"""Recordings read lazily: a file is gone through once for what is whole in it; scans are decoded as they are wanted."""

from __future__ import annotations

import json
import os
import weakref
import zlib
from bisect import bisect_right
from pathlib import Path
from typing import Any, NamedTuple

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
    # Of lasers whose description is damaged, until another one tells the same.
    undescribed: dict[int, list[_Block]] = {}
    scans = 0
    with open(source.number, "rb", closefd=False) as file:
        for record in records(file, damage):
            if record.kind == b"S":
                told = json.loads(zlib.decompress(record.body))
                number = told.pop("sensor")
                upside_down = told.pop("upside_down", None)  # older recordings do not tell
                described = by_number[number] = sensors.setdefault(json.dumps(told), _Blocks(source, told))
                described.upside_down = described.upside_down if upside_down is None else bool(upside_down)
                for block in undescribed.pop(number, ()):
                    described.add(block)
                continue
            number, _, beams, _ = BLOCK.unpack_from(record.body)
            block = _Block(record.at, len(record.body), zlib.crc32(record.body), beams, times(record.body))
            if number in by_number:
                by_number[number].add(block)
            else:
                undescribed.setdefault(number, []).append(block)
            scans += len(block.times)
    damage.undescribed = scans - sum(map(len, sensors.values()))
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


class _Block(NamedTuple):
    """Where a block is, how long it is, its check sum, how many beams its scans have, and their times (T,) s."""

    at: int
    length: int
    check: int
    beams: int
    times: Array


class _Blocks:
    """The scans of one sensor; of its blocks the one looked at last is kept decoded."""

    def __init__(self, source: _Source, told: dict[str, Any]) -> None:
        self._source, self._told = source, told
        self._blocks: list[_Block] = []
        self.upside_down: bool | None = None
        #: The number of the first scan of each block, and of the one after the last.
        self._firsts = [0]
        self._decoded: tuple[int, Array, Array | None] | None = None

    def add(self, block: _Block) -> None:
        """One more, unless it is of another sweep."""
        if block.beams == len(self._told["angles"]):
            self._blocks.append(block)
            self._firsts.append(self._firsts[-1] + len(block.times))

    def recorded(self) -> Recorded:
        x, y, theta = self._told["pose"]
        t = np.concatenate([block.times for block in self._blocks])
        sweep = Sweep.from_json(self._told)
        return Recorded(self._told["name"], sweep, (x, y, theta), t, self, upside_down=self.upside_down)

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
        here = self._blocks[block]
        body = self._source.read(here.at, here.length)
        if zlib.crc32(body) != here.check:
            raise CommandError(f"{self._source.path}: it changed while it was read")
        return unpacked(body, self._told["unit_m"])
