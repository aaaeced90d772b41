"""What a SCIP sensor says: replies that begin with the command they answer and end with an empty line.

``command LF status sum LF lines... LF``. Only replies whose every sum is right get through. Source: C-42-03320B.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from tms_agents.devices.framing import FrameBuffer
from tms_agents.devices.scip.encoding import checksum, encodes_values, join_blocks
from tms_agents.devices.scip.requests import Measure, OldMeasure

#: The longest reply: 10000 steps with intensity, their sums, the command, status and time stamp.
MAX_REPLY = 1 << 16
_COMMAND = re.compile(
    rb"(?:[MG][DSE][0-9]{10}(?:[0-9]{3})?|VV|PP|II|BM|QT|R[STB]|TM[012]|SS[0-9]{6}|CR[0-9]{2}|HS[01]|DB[0-9]{2}|%S[TL]"
    rb"|SCIP2\.0|V|L[01]|G[0-9]{8})(?:;[ -~]{0,16})?"
)
#: Where a reply may begin inside of what is none: a command and a status line.
_BEGINS = re.compile(rb"(?=" + _COMMAND.pattern + rb"\n(?:..)?.\n)", re.S)
#: Not a text of the host's: the reply that has it lost its end there, and another began.
_BROKEN_OFF = re.compile(rb";.*[MG][DSE][0-9]{10}")
_MEASURE = re.compile(rb"[MG][DSE][0-9]{10}")
_STATUS = re.compile(rb"[0-9A-Z]{1,2}")
_TEXT = re.compile(rb"[ -~]*")
_MOST_TRIES = 4
_STAMP = 4


@dataclass(frozen=True, slots=True)
class Reply:
    """``command`` as the sensor repeats it; ``status`` of two characters, of one in SCIP 1.1.

    ``lines`` without their sums. Those of a measurement are two: the time stamp and all data. A SCIP 1.1 measurement
    has one, its data; SCIP 1.1 knows no sums.
    """

    command: str
    status: str
    lines: tuple[bytes, ...] = ()


class ReplyParser(FrameBuffer):
    """Incremental: feed bytes as they come, get whole and right replies; ``skipped`` counts the bytes of all else.

    Holds at most ``MAX_REPLY`` bytes.
    """

    def feed(self, data: bytes) -> list[Reply]:
        buffer = self._buffer
        searched = max(len(buffer) - 1, 0)
        buffer += data
        replies, start = [], 0
        while (end := buffer.find(b"\n\n", searched)) >= 0:
            block = bytes(buffer[start : end + 1]).lstrip(b"\n")
            start = searched = end + 2
            if block:
                reply, skipped = _reply(block)
                self.skipped += skipped
                if reply is not None:
                    replies.append(reply)
        del buffer[:start]
        if len(buffer) > MAX_REPLY:
            self.expire()
        return replies


def parse_reply(block: bytes) -> Reply:
    """One reply without its empty line, each of its lines ended by a line feed.

    Lines of text with a wrong sum are left out: some firmware sends such (URG-04LX its serial number).

    Raises:
        ValueError: it is no reply, a measurement is not complete or has a wrong sum.
    """
    command, _, rest = block.partition(b"\n")
    status, _, rest = rest.partition(b"\n")
    if not _COMMAND.fullmatch(command) or _BROKEN_OFF.search(command):
        raise ValueError("no command")
    name, code = command.decode(), status[:2]
    if not _STATUS.fullmatch(code):
        raise ValueError("no status")
    if len(status) == 1:
        return Reply(name, code.decode(), _old_lines(name, rest))
    if len(status) != 3 or checksum(code) != status[2]:
        raise ValueError("a status with a wrong sum")
    return Reply(name, code.decode(), _lines(name, rest))


def text_line(line: bytes) -> bytes | None:
    """A line of text without its sum; None where that is wrong.

    The sum may count the ``;`` before it or not, and a remark behind ``<-`` or not: all of these are in use.
    """
    text, total = line[:-1], line[-1]
    if not _TEXT.fullmatch(text):
        return None
    plain = text.removesuffix(b";")
    for counted in (plain, text, plain.partition(b"<-")[0]):
        if checksum(counted) == total:
            return plain
    return None


def _reply(block: bytes) -> tuple[Reply | None, int]:
    """The reply of a block and how many of its bytes are none of it."""
    try:
        return parse_reply(block), 0
    except ValueError:
        pass
    # A reply that lost its end, or noise, may stand before a good one. Scans first: short commands occur by chance.
    begins = [found.start() for found in _BEGINS.finditer(block)]
    scans = [begin for begin in begins if _MEASURE.match(block, begin)]
    for begin in [*scans[: -_MOST_TRIES - 1 : -1], *begins[-_MOST_TRIES:]]:
        try:
            return parse_reply(block[begin:]), begin
        except ValueError:
            continue
    return None, len(block)


def _lines(command: str, rest: bytes) -> tuple[bytes, ...]:
    measure = Measure.parse(command)
    if measure is None or not rest:
        found = [text_line(line) for line in rest.split(b"\n") if line]
        return tuple(line for line in found if line is not None)
    stamp, _, blocks = rest.partition(b"\n")
    if len(stamp) != _STAMP + 1 or checksum(stamp[:_STAMP]) != stamp[_STAMP]:
        raise ValueError("no time stamp")
    chars = join_blocks(blocks)
    if len(chars) != measure.characters:
        raise ValueError(f"{len(chars)} characters of data instead of {measure.characters}")
    if not encodes_values(chars):
        raise ValueError("a character that encodes nothing")
    return stamp[:_STAMP], chars.tobytes()


def _old_lines(command: str, rest: bytes) -> tuple[bytes, ...]:
    lines = tuple(line for line in rest.split(b"\n") if line)
    measure = OldMeasure.parse(command)
    if measure is None or not lines:
        return lines
    data = b"".join(lines)
    if len(data) != measure.characters:
        raise ValueError(f"{len(data)} characters of data instead of {measure.characters}")
    return (data,)
