"""LLRP bytes to messages and back, driven by the tables.

``FrameParser`` cuts a byte stream into messages; ``decode`` and ``encode`` turn one message into a tree of parameters
and back. ``encode(decode(b)) == b`` for every well-formed message with reserved bits zero.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from tms_agents.devices.framing import FrameBuffer
from tms_agents.devices.llrp.tables import MESSAGE_TYPES, MESSAGES, PARAMETER_TYPES, TLV, TV, Layout

HEADER = struct.Struct(">HII")
#: Longest message accepted. Real reports have some kilobytes; the length field could claim four gigabytes.
MAX_MESSAGE = 1 << 20
_MAX_DEPTH = 16
#: Reserved bits zero, version 1 or 2.
_FIRST_BYTE = re.compile(rb"[\x04-\x0b]")

Value = int | bytes | str | tuple[int, ...] | tuple[int, bytes]


class LlrpError(ValueError):
    """Bytes that are no LLRP message."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """``values`` by field name; a type that is not in the tables is named ``TLV<type>`` and has ``data``."""

    name: str
    values: Mapping[str, Value] = field(default_factory=dict)
    children: tuple[Parameter, ...] = ()

    def find(self, name: str) -> Parameter | None:
        """The first child of that name."""
        return next(self.all(name), None)

    def all(self, name: str) -> Iterator[Parameter]:
        return (child for child in self.children if child.name == name)

    def number(self, name: str) -> int:
        value = self.values[name]
        assert isinstance(value, int)
        return value

    def text(self, name: str) -> str:
        value = self.values[name]
        assert isinstance(value, str)
        return value

    def hex(self, name: str) -> str:
        """The bytes of a byte or bit field as upper-case hex."""
        value = self.values[name]
        raw = value[1] if isinstance(value, tuple) else value
        assert isinstance(raw, bytes)
        return raw.hex().upper()


@dataclass(frozen=True, slots=True)
class Message(Parameter):
    id: int = 0
    version: int = 1


class FrameParser(FrameBuffer):
    """Incremental: feed bytes as they come, get whole messages.

    What cannot be a message header (reserved bits, version, unknown type, absurd length) or is a malformed message is
    skipped byte by byte until a message fits; ``skipped`` counts. At most ``MAX_MESSAGE`` bytes are held.
    """

    def feed(self, data: bytes) -> list[Message]:
        """Messages completed by ``data``, in order."""
        messages = []
        # In pieces: however much arrives at once, the buffer stays bounded.
        for start in range(0, len(data), MAX_MESSAGE):
            self._buffer += data[start : start + MAX_MESSAGE]
            messages += self._cut()
        return messages

    def _cut(self) -> list[Message]:
        messages: list[Message] = []
        buffer, at = self._buffer, 0
        while len(buffer) - at >= HEADER.size:
            start = _FIRST_BYTE.search(buffer, at)
            skip = (start.start() if start else len(buffer)) - at
            if skip:
                at += skip
                self.skipped += skip
                continue
            kind, length, _ = HEADER.unpack_from(buffer, at)
            if (kind & 0x3FF) not in MESSAGES or not HEADER.size <= length <= MAX_MESSAGE:
                at += 1
                self.skipped += 1
                continue
            if len(buffer) - at < length:
                break
            try:
                messages.append(decode(bytes(buffer[at : at + length])))
                at += length
            except LlrpError:
                at += 1
                self.skipped += 1
        del buffer[:at]
        return messages


def decode(data: bytes) -> Message:
    """One whole message.

    Raises:
        LlrpError: lengths do not add up, or fields are cut off.
    """
    if len(data) < HEADER.size:
        raise LlrpError("shorter than a header")
    kind, length, message_id = HEADER.unpack_from(data)
    layout = MESSAGES.get(kind & 0x3FF)
    if layout is None or length != len(data):
        raise LlrpError(f"no message of type {kind & 0x3FF} and {length} bytes")
    return decode_body(kind & 0x3FF, data[HEADER.size :], message_id, kind >> 10 & 7)


def decode_body(kind: int, body: bytes, message_id: int = 0, version: int = 1) -> Message:
    """A message of type ``kind`` from what follows its header."""
    values, children = _content(MESSAGES[kind], body, 0)
    return Message(MESSAGES[kind].name, values, children, message_id, version)


def encode(message: Message) -> bytes:
    kind = MESSAGE_TYPES[message.name]
    body = _encode_content(MESSAGES[kind], message)
    return HEADER.pack(message.version << 10 | kind, HEADER.size + len(body), message.id) + body


def _content(layout: Layout, data: bytes, depth: int) -> tuple[dict[str, Value], tuple[Parameter, ...]]:
    values: dict[str, Value] = {}
    at = 0
    try:
        for name, code in layout.fields:
            values[name], at = _read(code, data, at)
    except struct.error as error:
        raise LlrpError(f"{layout.name}: {error}") from error
    if layout.nested:
        return values, tuple(_parameters(data, at, depth + 1))
    if at != len(data):
        raise LlrpError(f"{layout.name}: {len(data) - at} bytes too many")
    return values, ()


def _parameters(data: bytes, at: int, depth: int) -> Iterator[Parameter]:
    if depth > _MAX_DEPTH:
        raise LlrpError("parameters nested too deep")
    while at < len(data):
        if data[at] & 0x80:
            layout = TV.get(data[at] & 0x7F)
            if layout is None:
                raise LlrpError(f"unknown TV parameter {data[at] & 0x7F}")
            end = at + 1 + _fixed_size(layout)
            start = at + 1
        else:
            if len(data) - at < 4:
                raise LlrpError("a parameter header is cut off")
            kind, length = struct.unpack_from(">HH", data, at)
            kind &= 0x3FF
            start, end = at + 4, at + length
            layout = TLV.get(kind) or Layout(f"TLV{kind}", (("data", "*"),))
        if not start <= end <= len(data):
            raise LlrpError(f"{layout.name}: wrong length")
        values, children = _content(layout, data[start:end], depth)
        yield Parameter(layout.name, values, children)
        at = end


def _read(code: str, data: bytes, at: int) -> tuple[Value, int]:
    if code == "*":
        return data[at:], len(data)
    if code in "BHIQbh":
        number = struct.unpack_from(f">{code}", data, at)[0]
        return int(number), at + struct.calcsize(code)
    if code.isdigit():
        return struct.unpack_from(f"{code}s", data, at)[0], at + int(code)
    (count,) = struct.unpack_from(">H", data, at)
    at += 2
    if code in "al":
        item = "H" if code == "a" else "I"
        return struct.unpack_from(f">{count}{item}", data, at), at + struct.calcsize(f">{count}{item}")
    size = (count + 7) // 8 if code == "e" else count
    raw: bytes = struct.unpack_from(f"{size}s", data, at)[0]
    return (raw.decode("utf-8", "surrogateescape") if code == "s" else (count, raw)), at + size


def _encode_content(layout: Layout, parameter: Parameter) -> bytes:
    fields = b"".join(_write(code, parameter.values[name]) for name, code in layout.fields)
    return fields + b"".join(map(_encode_parameter, parameter.children))


def _encode_parameter(parameter: Parameter) -> bytes:
    kind = PARAMETER_TYPES.get(parameter.name)
    if kind is None:
        kind, layout = int(parameter.name.removeprefix("TLV")), Layout(parameter.name, (("data", "*"),))
    elif kind in TV:
        return bytes([0x80 | kind]) + _encode_content(TV[kind], parameter)
    else:
        layout = TLV[kind]
    content = _encode_content(layout, parameter)
    return struct.pack(">HH", kind, 4 + len(content)) + content


def _write(code: str, value: Value) -> bytes:
    if isinstance(value, int):
        return struct.pack(f">{code}", value)
    if isinstance(value, bytes):
        return value
    if isinstance(value, str):
        text = value.encode("utf-8", "surrogateescape")
        return struct.pack(">H", len(text)) + text
    if code in "ey":
        count, raw = value
        assert isinstance(raw, bytes)
        return struct.pack(">H", count) + raw
    return struct.pack(f">H{len(value)}{'H' if code == 'a' else 'I'}", len(value), *value)


def _fixed_size(layout: Layout) -> int:
    return sum(int(code) if code.isdigit() else struct.calcsize(code) for _, code in layout.fields)
