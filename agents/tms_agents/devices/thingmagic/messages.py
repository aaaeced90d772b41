"""What the frames mean: commands, tags in replies, status codes in words. Source: Mercury API, serial reader."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from tms_agents.devices.tags import TagRead
from tms_agents.devices.thingmagic.codec import Command, Reply

VERSION, BOOT = 0x03, 0x04
READ_SINGLE, READ_MULTIPLE, GET_BUFFER, CLEAR_BUFFER = 0x21, 0x22, 0x29, 0x2A
SET_ANTENNA, SET_READ_POWER, SET_PROTOCOL, SET_REGION = 0x91, 0x92, 0x93, 0x97
GET_ANTENNA, GET_READ_POWER, GET_PROTOCOL, GET_REGION = 0x61, 0x62, 0x63, 0x67
GET_POWER_MODE, SET_POWER_MODE = 0x68, 0x98

OK, INVALID_COMMAND, NO_TAGS, BUFFER_EMPTY = 0x0000, 0x0101, 0x0400, 0x0600
GEN2 = 0x0005
REGIONS = {"NA": 1, "EU": 2, "KR": 3, "IN": 4, "JP": 5, "PRC": 6, "EU2": 7, "EU3": 8, "KR2": 9, "OPEN": 0xFF}
#: Metadata wanted with every tag: read count, RSSI, antenna.
METADATA = 0x0007
_COUNT, _RSSI, _ANTENNA, _PROTOCOL, _DATA, _GPIO = 1, 2, 4, 0x40, 0x80, 0x100
#: Fields that are passed over, by flag: frequency, time, phase, protocol.
_PASSED_OVER = {0x08: 3, 0x10: 4, 0x20: 2, _PROTOCOL: 1}

_MEANINGS = {
    0x0100: "wrong number of data bytes",
    INVALID_COMMAND: "invalid command (is it still in the boot loader?)",
    0x0102: "command not implemented",
    0x0103: "power too high",
    0x0104: "frequency not allowed",
    0x0105: "wrong parameter value",
    0x0106: "power too low",
    0x0109: "feature not implemented",
    0x010A: "baud rate not possible",
    0x010B: "region not possible",
    0x0200: "damaged firmware image",
    0x0201: "damaged firmware image",
    NO_TAGS: "no tag found",
    0x0401: "no tag protocol set",
    0x0402: "tag protocol not possible",
    0x0404: "no data read from the tag",
    0x0405: "radio frequency part is not on",
    0x040A: "tag error",
    0x0410: "tag with an invalid EPC",
    0x0500: "frequency not possible",
    0x0501: "channel is occupied",
    0x0502: "transmitter is on already",
    0x0503: "antenna is not connected",
    0x0504: "too hot",
    0x0505: "antenna reflects too much power",
    0x0507: "antenna configuration not possible",
    BUFFER_EMPTY: "fewer tags in the buffer than asked for",
    0x0601: "tag buffer is full",
    0x0603: "too many tags asked for",
    0x7F00: "internal error",
    0x7F01: "internal error (assertion)",
}


def meaning(status: int) -> str:
    return f"status {status:04X} {_MEANINGS.get(status, '')}".strip()


def boot() -> Command:
    """Start the reader's firmware from its boot loader."""
    return Command(BOOT)


def set_region(region: str) -> Command:
    """``region``: a key of ``REGIONS``; it decides on the legal frequencies."""
    return Command(SET_REGION, bytes([REGIONS[region]]))


def set_protocol(protocol: int = GEN2) -> Command:
    return Command(SET_PROTOCOL, protocol.to_bytes(2, "big"))


def set_read_power(dbm: float) -> Command:
    return Command(SET_READ_POWER, struct.pack(">h", round(100 * dbm)))


def set_antenna(antenna: int) -> Command:
    """One port that transmits and receives."""
    return Command(SET_ANTENNA, bytes([antenna, antenna]))


def clear_buffer() -> Command:
    return Command(CLEAR_BUFFER)


def read_single(read_ms: int) -> Command:
    """Answered by one tag, or status ``NO_TAGS``."""
    return Command(READ_SINGLE, read_ms.to_bytes(2, "big"))


def read_multiple(read_ms: int) -> Command:
    """Collect tags in the reader's buffer, from the antenna that is set; answered by their number, or ``NO_TAGS``."""
    return Command(READ_MULTIPLE, struct.pack(">BHH", 0, 0, read_ms))


def get_buffer() -> Command:
    """The next tags of the buffer, as many as fit into a frame."""
    return Command(GET_BUFFER, struct.pack(">HB", METADATA, 0))


def single_tag(reply: Reply) -> str | None:
    """EPC (upper-case hex) of a reply to ``read_single``, which ends with the CRC of the tag."""
    return reply.data[:-2].hex().upper() or None


def tag_count(reply: Reply) -> int | None:
    """Number of tags that ``read_multiple`` found; None for a reply of no known form.

    One byte, or four of readers for large numbers; newer ones put one more option byte before it.
    """
    size = len(reply.data)
    if size not in (4, 5, 7, 8):
        return None
    return int.from_bytes(reply.data[4 if size in (5, 8) else 3 :], "big")


def buffered_tags(reply: Reply, antenna: int = 0) -> list[TagRead] | None:
    """Tags of a reply to ``get_buffer``; None where it is not well formed. ``antenna`` for tags that do not say."""
    try:
        flags, _, count = struct.unpack_from(">HBB", reply.data)
        at, reads = 4, []
        for _ in range(count):
            read, at = _tag(reply.data, at, flags, antenna)
            reads.append(read)
    except (struct.error, IndexError):
        return None
    return reads if at == len(reply.data) else None


def _tag(data: bytes, at: int, flags: int, antenna: int) -> tuple[TagRead, int]:
    count, rssi = 1, None
    if flags & _COUNT:
        count, at = data[at], at + 1
    if flags & _RSSI:
        rssi, at = float(struct.unpack_from(">b", data, at)[0]), at + 1
    if flags & _ANTENNA:
        # transmitting port in the upper half, receiving port in the lower one
        antenna, at = data[at] >> 4 or data[at] & 0xF, at + 1
    at += sum(size for flag, size in _PASSED_OVER.items() if flags & flag)
    if flags & _DATA:
        (bits,) = struct.unpack_from(">H", data, at)
        at += 2 + (bits + 7) // 8
    at += 1 if flags & _GPIO else 0
    (bits,) = struct.unpack_from(">H", data, at)
    word, end = data[at + 2 : at + 2 + bits // 8], at + 2 + bits // 8
    epc = word[_control_size(word) : -2]
    if bits % 8 or end > len(data) or not epc:
        raise IndexError(bits)
    return TagRead(tag=epc.hex().upper(), antenna=antenna, rssi_dbm=rssi, count=count), end


def _control_size(word: bytes) -> int:
    """Bytes before the EPC: the PC word, and the XPC words it announces."""
    if not word[0] & 0x02:
        return 2
    return 6 if word[2] & 0x80 else 4


def encode_buffered(reads: Sequence[TagRead]) -> bytes:
    """Data of a reply to ``get_buffer`` with ``METADATA``: what an emulator sends."""
    data = struct.pack(">HBB", METADATA, 0, len(reads))
    for read in reads:
        epc = bytes.fromhex(read.tag)
        port = read.antenna << 4 | read.antenna
        data += struct.pack(">BbBH", min(read.count, 255), round(read.rssi_dbm or 0), port, 8 * (len(epc) + 4))
        data += (len(epc) // 2 << 11).to_bytes(2, "big") + epc + b"\xd1\x00"
    return data
