"""The protocol of a Pioneer: synchronise in three steps, open, then listen, with a sign of life every second."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from tms_agents.devices.arcos import codec
from tms_agents.devices.arcos.codec import Packet, PacketParser, command
from tms_agents.devices.arcos.models import mm_per_unit
from tms_agents.devices.arcos.odometry import Odometry
from tms_agents.devices.arcos.sip import Status, parse_status
from tms_agents.devices.outgoing import Outgoing

#: The robot stops two seconds after it heard from the host for the last time.
_PULSE_S = 1.0
_LOW_V = 11.0


@dataclass(frozen=True, kw_only=True, slots=True)
class BaseStatus:
    """``pose``: odometry (m, m, rad), going on from where it began; ``speed`` m/s, ``turn`` rad/s.

    ``stalled``: a wheel does not turn though it should. ``front`` and ``rear``: a bit per bumper that is pressed.
    """

    pose: tuple[float, float, float]
    speed: float
    turn: float
    battery_v: float
    moving: bool
    motors: bool
    stalled: bool = False
    front: int = 0
    rear: int = 0


class ArcosSession(Outgoing):
    """``drives``: the motors are switched on, and ``drive`` moves the robot; otherwise it is only listened to.

    ``unit_mm``: millimetres per unit of position, by default as the robot's model has it. A robot that another session
    left open is closed first. What is not answered within ``reply_s`` is asked again from the beginning.
    """

    def __init__(
        self,
        *,
        odometry: Odometry | None = None,
        drives: bool = False,
        unit_mm: float | None = None,
        reply_s: float = 0.5,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self.frames = 0
        self.ready = False
        self.tick_s = 0.05
        self.odometry = odometry or Odometry()
        self.odometry.anchor()
        self.name, self.model = "", ""
        self._drives, self._unit_mm, self._reply_s, self._clock = drives, unit_mm, reply_s, clock
        self._parser = PacketParser()
        self._step: int | None = codec.SYNC0
        self._asked_at = self._told_at = self._heard_at = clock()
        self._closed_at = -math.inf
        self._low = False

    @property
    def note(self) -> str:
        known = self._unit_mm is not None or mm_per_unit(self.model) is not None
        said = [f"{self.model} {self.name}".strip()]
        said += [] if known or not self.model else ["unknown model, its units are taken for millimetres"]
        said += [f"battery below {_LOW_V:g} V"] if self._low else []
        return ", ".join(one for one in said if one)

    @property
    def pending(self) -> int:
        """Bytes of an incomplete packet."""
        return self._parser.pending

    def drive(self, speed: float, turn: float) -> None:
        """m/s ahead and rad/s counter-clockwise, until told otherwise. Raises ``ValueError`` where it only listens."""
        if not self._drives:
            raise ValueError("this session only listens")
        if self.ready:
            self._say(command(codec.VEL, _bounded(1000 * speed)), command(codec.RVEL, _bounded(math.degrees(turn))))

    def opened(self) -> None:
        self._ask(codec.SYNC0)

    def receive(self, data: bytes) -> list[BaseStatus]:
        self._heard_at = self._clock()
        items: list[BaseStatus] = []
        for packet in self._parser.feed(data):
            self.frames += 1
            if self._step is not None:
                self._synchronise(packet)
            elif (status := parse_status(packet)) is not None:
                items.append(self._told(status))
            elif packet == Packet(codec.SYNC0):
                # A sign of life has the bytes of the first step: only a robot that was restarted echoes it.
                self.odometry.anchor()
                self._ask(codec.SYNC0)
        return items

    def tick(self) -> None:
        now = self._clock()
        if self._parser.pending and now - self._heard_at > self._reply_s:
            self._parser.expire()
        if self._step is not None and now - self._asked_at > self._reply_s:
            self._ask(codec.SYNC0)
        if self._step is None and now - self._told_at >= _PULSE_S:
            self._say(command(codec.PULSE))

    def closing(self) -> bytes:
        if self._step is not None:
            return b""
        return (command(codec.STOP).encode() if self._drives else b"") + command(codec.CLOSE).encode()

    def _synchronise(self, packet: Packet) -> None:
        """The robot echoes each step; behind the last it tells who it is."""
        if packet.id in (codec.STOPPED, codec.MOVING):
            # It is open still, and will hear no synchronisation before it is closed.
            if self._clock() - self._closed_at > self._reply_s:
                self._closed_at = self._clock()
                self._say(command(codec.CLOSE))
                self._ask(codec.SYNC0)
        elif packet.id != self._step:
            return  # a late echo
        elif packet.id < codec.SYNC2:
            self._ask(packet.id + 1)
        else:
            names = packet.data.split(b"\0")
            self.name = names[0].decode("latin-1")
            self.model = names[2].decode("latin-1") if len(names) > 2 else ""
            self._step = None
            self._say(command(codec.OPEN), command(codec.SONAR, 0))
            if self._drives:
                self._say(command(codec.ENABLE, 1))

    def _told(self, status: Status) -> BaseStatus:
        self.ready = True
        unit_mm = self._unit_mm or mm_per_unit(self.model) or 1.0
        pose = self.odometry.take((status.x, status.y, status.heading), self._clock(), unit_mm)
        self._low = status.battery / 10 < _LOW_V
        # Wheels that differ by 1 mm/s turn the robot by 0.0056 / 2 rad/s: the width of a P3-DX.
        turn = (status.right - status.left) * 0.0028 if status.rotation is None else math.radians(status.rotation / 10)
        return BaseStatus(
            pose=pose,
            speed=(status.left + status.right) / 2000,
            turn=turn,
            battery_v=status.battery / 10,
            moving=status.moving,
            motors=status.motors,
            stalled=status.stalled_left or status.stalled_right,
            front=status.front,
            rear=status.rear,
        )

    def _ask(self, step: int) -> None:
        self._step, self._asked_at = step, self._clock()
        self._say(command(step))

    def _say(self, *packets: Packet) -> None:
        self._told_at = self._clock()
        for packet in packets:
            self._output += packet.encode()


def _bounded(value: float) -> int:
    return max(-0x7FFF, min(0x7FFF, round(value)))
