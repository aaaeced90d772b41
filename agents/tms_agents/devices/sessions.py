"""What a driver is: the protocol of a device without I/O."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, TypeVar, runtime_checkable

T_co = TypeVar("T_co", covariant=True)


class DeviceFault(Exception):
    """The device refuses or answers nonsense; the text says why. The link starts anew."""


@dataclass(frozen=True, slots=True)
class DeviceState:
    state: Literal["connected", "silent", "faulty"]
    why: str = ""


class Session(Protocol[T_co]):
    """The protocol of one connection, without I/O. Each method may raise ``DeviceFault``."""

    #: Valid frames so far: the sign of life. ``ready``: the device is set up and delivers.
    frames: int
    ready: bool

    def opened(self) -> None:
        """The stream is open."""

    def receive(self, data: bytes) -> Sequence[T_co]:
        """Take bytes in pieces of any size; returns the readings they complete."""

    def tick(self) -> None:
        """Called several times a second, more often where the session is ``Paced``: poll, keep alive.

        What had arrived by the call of a tick, but for the moment it takes to call it, was received before.
        """

    def output(self) -> bytes:
        """Bytes to send now; each is given out once."""

    def closing(self) -> bytes:
        """What to send before the stream is closed on our side."""


@runtime_checkable
class Paced(Protocol):
    """A session that says itself when it is to be ticked, at the latest."""

    @property
    def tick_s(self) -> float:
        """Seconds from now; asked again after every tick. 0: at once, after one more look at the line."""


@runtime_checkable
class Patient(Protocol):
    """A session that knows how long a device may say nothing, and says itself what is missing then."""

    @property
    def quiet_s(self) -> float:
        """At present no silence up to so long, since the last frame or the opening, is worth a word of the link.

        Asked again at every look; 0 where the link is to judge.
        """


@runtime_checkable
class Noted(Protocol):
    """A session that has something to add to the state of a device that works: what it is, what it complains of."""

    @property
    def note(self) -> str:
        """May change at any time; empty where there is nothing to add."""


@runtime_checkable
class Polled(Paced, Protocol):
    """A paced session whose input is looked at when it is ticked, not at every byte: far fewer wake-ups."""

    polled: bool


@runtime_checkable
class Prompt(Protocol[T_co]):
    """A session that can have its readings earlier where they are waited for."""

    #: Somebody waits for every reading: it may cost more to have it early.
    prompt: bool

    def finished(self) -> Sequence[T_co]:
        """Readings that were completed by a tick; each is given out once, here or by ``receive``."""


@runtime_checkable
class Asking(Prompt[T_co], Protocol[T_co]):
    """A session that asks one question after the other, quickly: short ways for what happens most of the time."""

    def answered(self, data: bytes) -> bytes | None:
        """What to send, if anything, when ``data`` is just the answer that was waited for.

        None where it is anything else: then nothing was taken, and ``receive`` has to look at it.
        """

    def nothing_by(self, now: float) -> None:
        """At a look at the line after ``now``, time of the session's clock, nothing was there. A tick follows."""
