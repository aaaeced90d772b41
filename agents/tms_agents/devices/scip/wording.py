"""How a sensor words its replies: what the emulator says."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.scip.encoding import checksum, cut_blocks, encode
from tms_agents.devices.scip.models import Model

_FAR_AWAY = 1 << 30
_LINE_SPEED = 19200


def line(text: str) -> bytes:
    """Data with its sum."""
    raw = text.encode("latin-1")
    return raw + bytes([checksum(raw)]) + b"\n"


def field(text: str, counted: str | None = None) -> bytes:
    """A line of text; ``counted`` is the part that its sum counts, None for all of it."""
    raw = (text if counted is None else counted).encode("latin-1")
    return text.encode("latin-1") + b";" + bytes([checksum(raw)]) + b"\n"


def reply(command: str, status: str, body: bytes = b"") -> bytes:
    return command.encode("latin-1") + b"\n" + line(status) + body + b"\n"


def fields(texts: Iterable[str], *, remarks_unsummed: bool = False) -> bytes:
    return b"".join(field(text, text.partition("<-")[0] if remarks_unsummed else None) for text in texts)


def version(model: Model) -> list[str]:
    return [
        f"VEND:{model.vendor}",
        f"PROD:{model.product}",
        f"FIRM:{model.firmware}",
        f"PROT:{model.protocol}",
        f"SERI:{model.serial}",
    ]


def state(model: Model, *, laser_on: bool, speed: int, baud: int, stamp_ms: int, broken: bool) -> list[str]:
    """Lines of II."""
    if model.states:
        motor, line_speed = str(speed), "Ethernet 100[Mbps]"
        mode, well = "Measuring by Sensitive Mode", "sensor is working normally"
    else:
        standard = speed == model.parameters.scan
        motor = f"Initial({speed}[rpm])<-Default setting by user" if standard else f"Level 05({speed}[rpm])"
        line_speed = f"{baud}[bps]" + ("<-Default setting by user" if baud == _LINE_SPEED else "")
        mode, well = "Measuring by Normal Mode" if laser_on else "IDLE", "Sensor works well."
    return [
        f"MODL:{model.parameters.modl}",
        f"LASR:{'ON' if laser_on else 'OFF'}",
        f"SCSP:{motor}",
        f"MESM:{mode}",
        f"SBPS:{line_speed}",
        f"TIME:{stamp_ms:06X}",
        f"STAT:{'Laser trouble.' if broken else well}",
    ]


def stamp(milliseconds: int) -> bytes:
    """The line of a time stamp."""
    return line(encode(np.array([milliseconds]), 4).decode())


def data(raw: NDArray[np.int32], intensities: NDArray[np.int32] | None, width: int) -> bytes:
    """The lines of a measurement, values (n,)."""
    values = raw if intensities is None else np.stack((raw, intensities), axis=1).ravel()
    return cut_blocks(encode(values, width))


def nearest(raw: NDArray[np.int32], valid: NDArray[np.bool_], cluster: int) -> NDArray[np.intp]:
    """Of each cluster the index of its nearest valid value, of its first where none is valid."""
    groups = -(-len(raw) // cluster)
    keys = np.full(groups * cluster, _FAR_AWAY + 1, np.int64)
    keys[: len(raw)] = np.where(valid, raw, _FAR_AWAY)
    picked: NDArray[np.intp] = np.arange(groups) * cluster + keys.reshape(groups, cluster).argmin(axis=1)
    return picked
