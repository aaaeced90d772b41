"""What the telegrams mean: commands, modes, status and configuration. Source: SICK 8007954, telegram listing LMS2xx."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from typing import Literal

SWITCH_MODE, REQUEST, STATUS, TYPE, VARIANT = 0x20, 0x30, 0x31, 0x3A, 0x3B
READ_CONFIG, WRITE_CONFIG = 0x74, 0x77
#: Replies that no command asks for: the device was switched on, it does not know a command.
POWER_ON, UNKNOWN_COMMAND = 0x90, 0x92
#: Telegrams with measured values: ranges, ranges with reflectivity.
RANGES, RANGES_AND_REFLECTIVITY = 0xB0, 0xC4

INSTALLATION, STREAM, ON_REQUEST, STREAM_PARTIAL, STREAM_REFLECTIVITY = 0x00, 0x24, 0x25, 0x2A, 0x50
#: Mode codes that change the rate of the line.
BAUD_CODES = {38400: 0x40, 19200: 0x41, 9600: 0x42, 500000: 0x48}
PASSWORD = b"SICK_LMS"

Unit = Literal["cm", "mm"]
#: Bits of a value that are the distance, by measuring mode; the others tell of fields or reflectors.
DISTANCE_BITS = {0x00: 13, 0x01: 13, 0x02: 13, 0x03: 14, 0x04: 14, 0x05: 15, 0x06: 15, 0x0F: 15}
#: The mode in which the device sends how strong the echo is, and no distance.
ECHO_MODE = 0x3F
CONFIG_BYTES = 34
_SEVERITIES = ("", "information", "warning", "error", "fatal error", "error 5", "error 6", "error 7")
_IMPLAUSIBLE, _POLLUTED = 0x40, 0x80
#: From here on a status byte says that nothing measured is to be believed.
_ERROR = 3


def reply_to(command: int) -> int:
    return command + 0x80


def switch_mode(mode: int, data: bytes = b"") -> bytes:
    return bytes([SWITCH_MODE, mode]) + data


def installation(password: bytes = PASSWORD) -> bytes:
    """Into the mode in which the configuration can be written."""
    return switch_mode(INSTALLATION, password)


def stream_reflectivity(first: int, last: int) -> bytes:
    """Stream ranges, and the reflectivity of the beams ``first`` to ``last`` (the first beam is 1)."""
    return switch_mode(STREAM_REFLECTIVITY, struct.pack("<HH", first, last))


def variant(angle_deg: int, resolution_deg: float) -> bytes:
    return bytes([VARIANT]) + struct.pack("<HH", angle_deg, round(100 * resolution_deg))


def request_scan() -> bytes:
    return bytes([REQUEST, 0x01])


def trouble(status: int) -> str:
    """What a status byte complains of; empty where all is well."""
    said = [_SEVERITIES[status & 7]] if status & 7 else []
    said += ["implausible values"] if status & _IMPLAUSIBLE else []
    said += ["the window is polluted"] if status & _POLLUTED else []
    return ", ".join(said)


def is_error(status: int) -> bool:
    return status & 7 >= _ERROR


@dataclass(frozen=True, slots=True)
class Config:
    """The configuration as the device keeps it; ``raw`` is written back as it was, but for what is changed."""

    raw: bytes

    @classmethod
    def of(cls, data: bytes) -> Config | None:
        """Of a reply to ``READ_CONFIG``; None where it is too short. Some devices send two bytes less."""
        return cls(data[:CONFIG_BYTES].ljust(CONFIG_BYTES, b"\x00")) if len(data) >= CONFIG_BYTES - 2 else None

    @property
    def measuring_mode(self) -> int:
        return self.raw[5]

    @property
    def unit(self) -> Unit:
        return "mm" if self.raw[6] else "cm"

    @property
    def sends_indices(self) -> bool:
        """Whether the availability asks for real-time indices behind the values."""
        return bool(self.raw[4] & 0x02)

    def changed(self, measuring_mode: int | None, unit: Unit | None) -> Config:
        raw = bytearray(self.raw)
        raw[5] = self.raw[5] if measuring_mode is None else measuring_mode
        raw[6] = self.raw[6] if unit is None else int(unit == "mm")
        return replace(self, raw=bytes(raw))


@dataclass(frozen=True, slots=True)
class Status:
    """What is used of a reply to ``STATUS``."""

    mode: int
    measuring_mode: int
    angle_deg: int
    resolution_deg: float
    unit: Unit

    @classmethod
    def of(cls, data: bytes) -> Status | None:
        """None where the reply is too short."""
        if len(data) < 123:
            return None
        angle, resolution = struct.unpack_from("<HH", data, 106)
        return cls(data[7], data[101], angle, resolution / 100, "mm" if data[121] else "cm")

    def encode(self) -> bytes:
        """The data of the reply, all else zero: what an emulator sends."""
        data = bytearray(151)
        data[:7] = b"V02.10 "
        data[7], data[101], data[121] = self.mode, self.measuring_mode, int(self.unit == "mm")
        struct.pack_into("<HH", data, 106, self.angle_deg, round(100 * self.resolution_deg))
        return bytes(data)
