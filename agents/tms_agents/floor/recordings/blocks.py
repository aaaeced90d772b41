"""A block of scans in a recording: times and ranges of about a second, each scan as the difference to the one before.

Ranges are 16 bit numbers in the sensor's unit, intensities whole numbers; all is compressed. Every block stands alone.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.scans import Array, Scan
from tms_agents.floor.recordings.records import BLOCK

_HAS_INTENSITIES, _HAS_DEVICE_TIME = 1, 2
_NO_ECHO, _ERROR = 0xFFFF, 0xFFFE
#: The largest number that is a range.
MOST_UNITS = _ERROR - 1


def packed(number: int, unit: float, scans: Sequence[tuple[float, Scan]]) -> bytes:
    ranges = np.array([scan.ranges for _, scan in scans])
    with np.errstate(invalid="ignore"):
        whole = np.clip(np.rint(np.nan_to_num(ranges, nan=0.0, posinf=0.0) / unit), 0, MOST_UNITS).astype(np.uint16)
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
    return BLOCK.pack(number, *whole.shape, what) + zlib.compress(b"".join(parts), 6)


def times(body: bytes) -> Array:
    """(T,) s; the rest stays packed."""
    _, scans, _, _ = BLOCK.unpack_from(body)
    return np.frombuffer(zlib.decompressobj().decompress(body[BLOCK.size :], 8 * scans), np.float64, scans)


def unpacked(body: bytes, unit: float) -> tuple[Array, Array | None]:
    """Ranges (T, B), intensities (T, B)."""
    _, scans, beams, what = BLOCK.unpack_from(body)
    data = zlib.decompress(body[BLOCK.size :])
    size = 2 * scans * beams
    whole = _unshuffled(data[8 * scans : 8 * scans + size], scans, beams)
    ranges = np.round(whole * unit, 6)
    ranges[whole == _NO_ECHO] = np.inf
    ranges[whole == _ERROR] = np.nan
    bright = None
    if what & _HAS_INTENSITIES:
        bright = _unshuffled(data[8 * scans + size : 8 * scans + 2 * size], scans, beams).astype(np.float64)
    return ranges, bright


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
