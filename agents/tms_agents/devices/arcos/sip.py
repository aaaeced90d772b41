"""The robot's standard packet (SIP), every 100 ms: raw position, wheels, battery, bumpers. Little end first.

Source: Pioneer 3 operations manual; AriaCoda ``ArRobot::processMotorPacket``; ``sip.cpp`` of p2os.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from tms_agents.devices.arcos.codec import MOVING, STOPPED, Packet

#: x, y, heading, left, right wheel, battery, stall and bumpers (left and rear, right and front), control, flags,
#: compass, number of sonars.
_FRONT = struct.Struct("<HHhhhBBBhHBB")
#: Chosen analogue port, analogue, digital in and out, battery, charging, turning, faults.
_BACK = struct.Struct("<HBBBHBhH")
_SONAR = struct.Struct("<BH")
_MOTORS = 1


@dataclass(frozen=True, kw_only=True, slots=True)
class Status:
    """Raw: ``x`` and ``y`` of 15 bits in units of the model, ``heading`` 4096 to the turn, wheels in mm/s.

    ``front`` and ``rear``: a bit per bumper that is pressed. ``battery`` and ``rotation`` in tenths (V, deg/s); the
    latter is None with firmware that does not tell.
    """

    moving: bool
    x: int
    y: int
    heading: int
    left: int
    right: int
    battery: int
    stalled_left: bool = False
    stalled_right: bool = False
    front: int = 0
    rear: int = 0
    motors: bool = False
    sonars: tuple[tuple[int, int], ...] = ()
    rotation: int | None = None

    def encode(self) -> Packet:
        """As the robot sends it."""
        front = _FRONT.pack(
            self.x & 0x7FFF,
            self.y & 0x7FFF,
            self.heading,
            self.left,
            self.right,
            min(self.battery, 255),
            self.rear << 1 | self.stalled_left,
            self.front << 1 | self.stalled_right,
            0,
            _MOTORS if self.motors else 0,
            0,
            len(self.sonars),
        )
        sonars = b"".join(_SONAR.pack(*one) for one in self.sonars)
        back = b"" if self.rotation is None else _BACK.pack(0, 0, 0, 0, self.battery, 0, self.rotation, 0)
        return Packet(MOVING if self.moving else STOPPED, front + sonars + back)


def parse_status(packet: Packet) -> Status | None:
    """None for another packet, and for one that is too short to be one."""
    if packet.id not in (STOPPED, MOVING) or len(packet.data) < _FRONT.size:
        return None
    x, y, heading, left, right, battery, low, high, _, flags, _, count = _FRONT.unpack_from(packet.data)
    at = _FRONT.size + count * _SONAR.size
    if len(packet.data) < at:
        return None
    rotation = None
    if len(packet.data) >= at + _BACK.size:
        *_, battery, _, rotation, _ = _BACK.unpack_from(packet.data, at)
    return Status(
        moving=packet.id == MOVING,
        x=x & 0x7FFF,
        y=y & 0x7FFF,
        heading=heading,
        left=left,
        right=right,
        battery=battery,
        stalled_left=bool(low & 1),
        stalled_right=bool(high & 1),
        front=high >> 1,
        rear=low >> 1,
        motors=bool(flags & _MOTORS),
        sonars=tuple(_SONAR.iter_unpack(packet.data[_FRONT.size : at])),
        rotation=rotation,
    )
