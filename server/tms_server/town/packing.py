"""A folded room as bytes: JSON and the engine's own bytes, compressed, behind a version and a checksum."""

from __future__ import annotations

import hashlib
import json
import zlib
from dataclasses import asdict
from typing import Any

from tms_schemas.rooms import RoomIn
from tms_server.log.record import Position
from tms_server.placement import ObjectSpec
from tms_server.town.state import AgentInfo, Evidence, Fault, LabelInfo, RoomState

_MAGIC = b"TMS room 1\n"
_DIGEST = 16


def pack(state: RoomState, position: Position, engine: bytes) -> bytes:
    document = {
        "position": position,
        "room": None if state.room is None else state.room.model_dump_json(by_alias=True),
        "names": state.names,
        "unseen": [asdict(spec) for spec in state.unseen.values()],
        "labels": state.labels,
        "agents": state.agents,
        "evidence": state.evidence,
        "anomalies": list(state.anomalies.items()),
        "unannounced": list(state.unannounced.items()),
        "contradiction": state.contradiction,
    }
    head = json.dumps(document, ensure_ascii=False, allow_nan=False).encode()
    body = zlib.compress(len(head).to_bytes(8, "little") + head + engine, 1)
    return _MAGIC + hashlib.blake2b(body, digest_size=_DIGEST).digest() + body


def unpack(data: bytes) -> tuple[RoomState, Position, bytes]:
    """Raises ``ValueError`` where the bytes are damaged or of another version."""
    if not data.startswith(_MAGIC):
        raise ValueError("not a folded room of this version")
    digest, body = data[len(_MAGIC) : len(_MAGIC) + _DIGEST], data[len(_MAGIC) + _DIGEST :]
    if hashlib.blake2b(body, digest_size=_DIGEST).digest() != digest:
        raise ValueError("the folded room is damaged (checksum)")
    content = zlib.decompress(body)
    size = int.from_bytes(content[:8], "little")
    document: dict[str, Any] = json.loads(content[8 : 8 + size])
    room = document["room"]
    state = RoomState(
        room=None if room is None else RoomIn.model_validate_json(room),
        names=document["names"],
        unseen={row["id"]: ObjectSpec(**row) for row in document["unseen"]},
        labels={name: _label(row) for name, row in document["labels"].items()},
        agents={name: AgentInfo(*row) for name, row in document["agents"].items()},
        evidence={tag: Evidence(*row) for tag, row in document["evidence"].items()},
        anomalies={(key[0], key[1], key[2]): Fault(*row) for key, row in document["anomalies"]},
        unannounced={(key[0], key[1]): Fault(*row) for key, row in document["unannounced"]},
        contradiction=document["contradiction"],
    )
    return state, Position(*document["position"]), content[8 + size :]


def _label(row: list[Any]) -> LabelInfo:
    info = LabelInfo(*row)
    x, y = info.xy
    return info._replace(xy=(x, y), cov=None if info.cov is None else (info.cov[0], info.cov[1], info.cov[2]))
