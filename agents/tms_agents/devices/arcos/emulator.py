"""A Pioneer for tests and demos, byte for byte; ``devices.emulation`` puts it behind a terminal or a port."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable

from tms_agents.devices.arcos import codec
from tms_agents.devices.arcos.codec import Packet, PacketParser, argument_of
from tms_agents.devices.arcos.models import mm_per_unit
from tms_agents.devices.arcos.odometry import HEADING_TURN
from tms_agents.devices.arcos.sip import Status

_PERIOD_S = 0.1
_WATCHDOG_S = 2.0

Pose = tuple[float, float, float]


class PioneerDevice:
    """Its line must tick several times in 100 ms: then it tells its state, once it is open.

    It moves as VEL and RVEL say while its motors are on, or as ``motion`` says: the odometry (m, m, rad) of this
    moment. It stops two seconds after the last packet of the host. ``silent`` and ``garble_next`` (packets) play
    faults; ``power_cycle`` forgets the position and what was opened.
    """

    def __init__(
        self,
        *,
        model: str = "p3dx-sh",
        name: str = "Emulated",
        motion: Callable[[], Pose] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.model, self.name, self.motion = model, name, motion
        self.silent = False
        self.garble_next = 0
        self.battery_v = 12.6
        self.front = self.rear = 0
        self.stalled = False
        #: Firmware that tells how fast it turns and the battery a second time.
        self.modern = True
        #: Packets received, for tests; the last thousand.
        self.heard: deque[Packet] = deque(maxlen=1000)
        self._clock = clock
        self.power_cycle()

    def power_cycle(self) -> None:
        self._parser = PacketParser()
        self._synchronised = 0
        self.open = self.motors = False
        self.speed = self.turn = 0.0
        self.pose: Pose = (0.0, 0.0, 0.0)
        self._offset: Pose = (0.0, 0.0, 0.0) if self.motion is None else self.motion()
        self._at = self._sent_at = self._heard_at = self._clock()

    def receive(self, data: bytes) -> bytes:
        """The answer to what the host sent."""
        self._move()
        answer = b""
        for packet in self._parser.feed(data):
            self.heard.append(packet)
            self._heard_at = self._clock()
            answer += self._obey(packet)
        return b"" if self.silent else answer

    def tick(self) -> bytes:
        """The state, every 100 ms."""
        self._move()
        if not self.open or self.silent or self._clock() - self._sent_at < _PERIOD_S - 1e-6:
            return b""
        # A beat that goes on without drifting, but never more than one at a time.
        self._sent_at = max(self._sent_at + _PERIOD_S, self._clock() - _PERIOD_S / 2)
        return self._out(self.status().encode().encode())

    def status(self) -> Status:
        unit_mm = mm_per_unit(self.model) or 1.0
        x, y, theta = self.pose
        wheels = 1000 * self.speed, self.turn / 0.0056
        return Status(
            moving=bool(self.speed or self.turn),
            x=round(1000 * x / unit_mm) & 0x7FFF,
            y=round(1000 * y / unit_mm) & 0x7FFF,
            heading=round(math.remainder(theta, math.tau) * HEADING_TURN / math.tau),
            left=_short(wheels[0] - wheels[1]),
            right=_short(wheels[0] + wheels[1]),
            battery=round(10 * self.battery_v),
            stalled_left=self.stalled,
            front=self.front,
            rear=self.rear,
            motors=self.motors,
            rotation=_short(10 * math.degrees(self.turn)) if self.modern else None,
        )

    def _obey(self, packet: Packet) -> bytes:
        if not self.open:
            return self._synchronise(packet)
        value = argument_of(packet)
        number = value if isinstance(value, int) else 0
        if packet.id == codec.CLOSE:
            self.open, self._synchronised = False, 0
            self.speed = self.turn = 0.0
        elif packet.id == codec.ENABLE:
            self.motors = number != 0
        elif packet.id == codec.VEL and self.motors:
            self.speed = number / 1000
        elif packet.id == codec.RVEL and self.motors:
            self.turn = math.radians(number)
        elif packet.id in (codec.STOP, codec.E_STOP):
            self.speed = self.turn = 0.0
        elif packet.id == codec.SETO:
            self._reset()
        return b""

    def _synchronise(self, packet: Packet) -> bytes:
        if packet.id == codec.OPEN and self._synchronised == 3:
            self.open = True
            self._reset()
            return b""
        if packet.id > codec.SYNC2 or packet.id > self._synchronised:
            return b""
        self._synchronised = packet.id + 1
        names = f"{self.name}\0Pioneer\0{self.model}\0".encode("latin-1") if packet.id == codec.SYNC2 else b""
        return self._out(Packet(packet.id, names).encode())

    def _reset(self) -> None:
        """Where it is now becomes its origin."""
        self.pose = (0.0, 0.0, 0.0)
        if self.motion is not None:
            self._offset = self.motion()
        self._sent_at = self._clock()

    def _move(self) -> None:
        since = self._clock() - self._at
        if self.motion is not None:
            if since >= _PERIOD_S / 2:  # shorter times tell nothing of speeds
                self._at = self._clock()
                self._follow(self.motion(), since)
            return
        self._at = self._clock()
        if self._clock() - self._heard_at > _WATCHDOG_S:
            self.speed = self.turn = 0.0
        x, y, theta = self.pose
        middle = theta + self.turn * since / 2
        way = self.speed * since
        self.pose = (x + math.cos(middle) * way, y + math.sin(middle) * way, theta + self.turn * since)

    def _follow(self, now: Pose, since: float) -> None:
        x0, y0, theta0 = self._offset
        dx, dy = now[0] - x0, now[1] - y0
        cos, sin = math.cos(theta0), math.sin(theta0)
        new = (cos * dx + sin * dy, cos * dy - sin * dx, now[2] - theta0)
        before = self.pose
        ahead = math.cos(before[2]) * (new[0] - before[0]) + math.sin(before[2]) * (new[1] - before[1])
        self.speed, self.turn = ahead / since, (new[2] - before[2]) / since
        self.pose = new

    def _out(self, data: bytes) -> bytes:
        if self.garble_next and data:
            self.garble_next -= 1
            return data[:-3] + bytes([data[-3] ^ 0x55]) + data[-2:]
        return data


def _short(value: float) -> int:
    return max(-0x8000, min(0x7FFF, round(value)))
