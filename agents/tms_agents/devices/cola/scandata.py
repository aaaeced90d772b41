"""LMDscandata, the telegram of one scan, in both dialects: to arrays and back, no loop over beams."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.cola.framing import Dialect, Telegram
from tms_agents.devices.cola.values import Reader, Writer
from tms_agents.devices.scans import Array, Sweep

NAME = "LMDscandata"
#: More of them no model has: an announcement of more is a damaged telegram.
_MOST_CHANNELS, _MOST_ENCODERS = 20, 4
#: Values in place of a distance: nothing came back; errors up to this one (1: dazzled, 2: implausible, 3: filtered).
_NO_ECHO, _LAST_ERROR = 0, 15
_TICKS = 10_000  # of a degree


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """``values`` (n,) as sent; what they mean is ``value * scale + offset``, distances in mm. Angles in degrees."""

    name: str
    values: NDArray[np.uint16]
    scale: float = 1.0
    offset: float = 0.0
    start_deg: float = -45.0
    step_deg: float = 1 / 3
    bits: Literal[8, 16] = 16

    def ranges(self) -> Array:
        """(n,) m; +inf where nothing echoed, NaN where the device tells of an error."""
        ranges = (self.values * self.scale + self.offset) / 1000
        ranges[self.values <= _LAST_ERROR] = math.nan
        ranges[self.values == _NO_ECHO] = math.inf
        return ranges

    def intensities(self) -> Array:
        """(n,) in the device's unit."""
        return np.asarray(self.values * self.scale + self.offset, np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class ScanData:
    """``status``: the two bytes of the device's state, the second has bits. ``layer``: of multi-layer models.

    ``since_start_us`` is the device's clock (32 bits) at the beginning of the turn, ``sent_us`` when it was sent.
    """

    channels: tuple[Channel, ...]
    serial: int = 0
    status: tuple[int, int] = (0, 0)
    telegrams: int = 0
    scans: int = 0
    since_start_us: int = 0
    sent_us: int = 0
    inputs: tuple[int, int] = (0, 0)
    outputs: tuple[int, int] = (0, 0)
    layer: int = 0
    scan_hz: float = 15.0
    measurement_hz: float = 0.0
    encoders: tuple[tuple[int, int], ...] = ()
    version: int = 1
    device: int = 1
    #: What follows the channels (position, name, comment, time, event); not needed.
    rest: bytes = field(default=b"", repr=False)

    def channel(self, name: str) -> Channel | None:
        return next((channel for channel in self.channels if channel.name == name), None)

    @classmethod
    def of(cls, reader: Reader) -> ScanData:
        """Of an ``sSN`` or ``sRA`` of which the name was read.

        Raises:
            ValueError: it is shorter than it says, or not of this form.
        """
        version, device, serial = reader.integer("H"), reader.integer("H"), reader.integer("I")
        status = reader.integer("B"), reader.integer("B")
        telegrams, scans = reader.integer("H"), reader.integer("H")
        since_start_us, sent_us = reader.integer("I"), reader.integer("I")
        inputs = reader.integer("B"), reader.integer("B")
        outputs = reader.integer("B"), reader.integer("B")
        layer = reader.integer("h")
        scan_hz, measurement_hz = reader.integer("I") / 100, reader.integer("I") * 100.0
        count = _few(reader.integer("H"), _MOST_ENCODERS)
        encoders = tuple((reader.integer("I"), reader.integer("H")) for _ in range(count))
        channels = [_channel(reader, 16) for _ in range(_few(reader.integer("H"), _MOST_CHANNELS))]
        channels += [_channel(reader, 8) for _ in range(_few(reader.integer("H"), _MOST_CHANNELS))]
        return cls(
            tuple(channels),
            serial,
            status,
            telegrams,
            scans,
            since_start_us,
            sent_us,
            inputs,
            outputs,
            layer,
            scan_hz,
            measurement_hz,
            encoders,
            version,
            device,
            reader.rest,
        )

    def telegram(self, dialect: Dialect) -> Telegram:
        return self.writer(dialect, "sSN").telegram()

    def writer(self, dialect: Dialect, verb: str) -> Writer:
        """What a device sends, without position, name, comment, time and event."""
        writer = Writer(dialect, verb, NAME)
        writer.put("H", self.version, self.device).put("I", self.serial).put("B", *self.status)
        writer.put("H", self.telegrams, self.scans).put("I", self.since_start_us, self.sent_us)
        writer.put("B", *self.inputs, *self.outputs).put("h", self.layer)
        writer.put("I", round(100 * self.scan_hz), round(self.measurement_hz / 100)).put("H", len(self.encoders))
        for position, speed in self.encoders:
            writer.put("I", position).put("H", speed)
        for bits in (16, 8):
            channels = [channel for channel in self.channels if channel.bits == bits]
            writer.put("H", len(channels))
            for channel in channels:
                writer.raw(channel.name).put("f", channel.scale, channel.offset)
                writer.put("i", round(channel.start_deg * _TICKS)).put("H", round(channel.step_deg * _TICKS))
                writer.put("H", len(channel.values)).array("H" if bits == 16 else "B", channel.values)
        return writer.put("H", 0, 0, 0, 0, 0)


@lru_cache(maxsize=16)
def sweep(
    start_deg: float,
    step_deg: float,
    count: int,
    scan_hz: float,
    measurement_hz: float,
    *,
    forward_deg: float,
    limits_m: tuple[float, float],
    model: str,
) -> Sweep:
    """The beams of a channel; ``forward_deg`` is the angle at which the device looks straight ahead.

    Where the device does not tell how many measurements it makes, the time between beams follows from one turn.
    """
    period_s = 1 / scan_hz if scan_hz > 0 else 0.0
    if measurement_hz > 1e6:  # some firmware tells it in Hz instead of hundreds
        measurement_hz /= 100
    return Sweep(
        angles=np.deg2rad(start_deg - forward_deg + step_deg * np.arange(count)),
        time_increment_s=1 / measurement_hz if measurement_hz > 0 else period_s * step_deg / 360,
        period_s=period_s,
        range_min_m=limits_m[0],
        range_max_m=limits_m[1],
        model=model,
    )


def to_values(ranges: Array, scale: float = 1.0) -> NDArray[np.uint16]:
    """What a device sends for ``ranges`` (n,) m with the offset 0; NaN becomes "dazzled"."""
    with np.errstate(invalid="ignore"):
        values = np.clip(np.round(ranges * 1000 / scale), _LAST_ERROR + 1, 65535)
    values[np.isnan(ranges)] = 1
    values[np.isinf(ranges)] = _NO_ECHO
    return values.astype(np.uint16)


def degrees_of_step(ticks: int) -> float:
    """A third of a degree comes as 3333 of 10,000; over 800 beams the rest would turn the last ones away."""
    twelfths = ticks * 12 / _TICKS
    return round(twelfths) / 12 if abs(twelfths - round(twelfths)) < 6 / _TICKS else ticks / _TICKS


def _few(count: int, most: int) -> int:
    if count > most:
        raise ValueError(f"{count} blocks announced, at most {most} are possible")
    return count


def _channel(reader: Reader, bits: Literal[8, 16]) -> Channel:
    name = reader.raw(5)
    scale, offset = reader.number("f"), reader.number("f")
    start, step, count = reader.integer("i"), reader.integer("H"), reader.integer("H")
    if not (math.isfinite(scale) and math.isfinite(offset)):
        raise ValueError(f"{name} has no scale")
    values = reader.array("H" if bits == 16 else "B", count)
    return Channel(name, values, scale, offset, start / _TICKS, degrees_of_step(step), bits)
