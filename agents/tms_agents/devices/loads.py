"""What every board of load cells and every scale delivers."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Sequence
from dataclasses import dataclass
from typing import Protocol

from tms_agents.devices.transport import DeviceState


@dataclass(frozen=True, kw_only=True, slots=True)
class LoadSample:
    """One look at the cells of one board or scale.

    ``values`` has one number per cell, counts of a board, grams of a scale; NaN where the device reports overload or
    nothing. ``stable`` is the device's own opinion, None where it has none. ``fault`` says what is wrong, "" when
    nothing is.
    """

    values: tuple[float, ...]
    stable: bool | None = None
    fault: str = ""


class LoadSource(Protocol):
    """A ``Link`` to a board or scale, or whatever listens like one."""

    def listen(self) -> AsyncGenerator[Sequence[LoadSample] | DeviceState, None]:
        """Samples in the groups they arrive in, and the state of the device whenever it changes."""
