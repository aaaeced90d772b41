"""ARCOS packets: ``FA FB n id data sum``; n counts what follows it, the sum of two bytes included.

The sum adds the bytes after n in pairs, big end first; an odd last byte is exclusive-ored into it. Arguments of
commands say their type: 3B an integer, 1B the magnitude of a negative one, 2B a text; both integers little end first.
Source: Pioneer 3 operations manual; AriaCoda ``ArRobotPacket``; ``p2os`` of Player and ROS.
"""

from __future__ import annotations

from dataclasses import dataclass

from tms_agents.devices.framing import FrameBuffer

HEAD = b"\xfa\xfb"
#: A packet has at most 207 bytes.
MAX_PACKET = 207
MAX_DATA = MAX_PACKET - 6
_POSITIVE, _NEGATIVE, _TEXT = 0x3B, 0x1B, 0x2B

SYNC0, SYNC1, SYNC2 = 0, 1, 2
PULSE, OPEN, CLOSE, ENABLE, SETO, VEL, RVEL, SONAR, STOP, E_STOP = 0, 1, 2, 4, 7, 11, 21, 28, 29, 55
#: Packets of the robot: its wheels stand still, or turn.
STOPPED, MOVING = 0x32, 0x33


@dataclass(frozen=True, slots=True)
class Packet:
    """``id``: a command of the host, or the kind of what the robot tells."""

    id: int
    data: bytes = b""

    def encode(self) -> bytes:
        """Raises ``ValueError`` where there is more data than a packet holds."""
        if len(self.data) > MAX_DATA:
            raise ValueError(f"{len(self.data)} bytes of data, a packet holds {MAX_DATA}")
        body = bytes([self.id]) + self.data
        return HEAD + bytes([len(body) + 2]) + body + checksum(body).to_bytes(2, "big")


def checksum(body: bytes | bytearray) -> int:
    """Of what lies between n and the sum itself."""
    total = 0
    for at in range(0, len(body) - 1, 2):
        total = (total + (body[at] << 8 | body[at + 1])) & 0xFFFF
    return total ^ body[-1] if len(body) % 2 else total


def command(id: int, argument: int | str | None = None) -> Packet:
    """A command with its argument. Raises ``ValueError`` for an integer of more than 16 bits."""
    if argument is None:
        return Packet(id)
    if isinstance(argument, str):
        text = argument.encode("latin-1")
        return Packet(id, bytes([_TEXT, len(text)]) + text)
    if abs(argument) > 0xFFFF:
        raise ValueError(f"{argument} has more than 16 bits")
    return Packet(id, bytes([_NEGATIVE if argument < 0 else _POSITIVE]) + abs(argument).to_bytes(2, "little"))


def argument_of(packet: Packet) -> int | str | None:
    """What ``command`` put in; None where there is none, or nothing that can be understood."""
    data = packet.data
    if len(data) == 3 and data[0] in (_POSITIVE, _NEGATIVE):
        value = int.from_bytes(data[1:], "little")
        return -value if data[0] == _NEGATIVE else value
    if len(data) >= 2 and data[0] == _TEXT and len(data) == 2 + data[1]:
        return data[2:].decode("latin-1")
    return None


class PacketParser(FrameBuffer):
    """Incremental: feed bytes as they come, get packets with a right sum; what is neither is counted in ``skipped``.

    Fewer than ``MAX_PACKET`` bytes are held.
    """

    def feed(self, data: bytes) -> list[Packet]:
        packets: list[Packet] = []
        for start in range(0, len(data), MAX_PACKET):
            self._buffer += data[start : start + MAX_PACKET]
            packets += self._cut()
        return packets

    def _cut(self) -> list[Packet]:
        packets, buffer, at = [], self._buffer, 0
        while at < len(buffer):
            head = buffer[at : at + 2]
            if head == HEAD[: len(head)]:
                end = at + 3 + buffer[at + 2] if len(buffer) - at > 2 else at + MAX_PACKET
                possible = len(buffer) - at <= 2 or at + 6 <= end <= at + MAX_PACKET
                if possible and end > len(buffer):
                    break
                if possible:
                    body = buffer[at + 3 : end - 2]
                    if checksum(body) == int.from_bytes(buffer[end - 2 : end], "big"):
                        packets.append(Packet(body[0], bytes(body[1:])))
                        at = end
                        continue
            at += 1
            self.skipped += 1
        del buffer[:at]
        return packets
