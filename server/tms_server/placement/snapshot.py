"""State files: a JSON header and little-endian arrays behind a checksum; they load on any machine and build."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from tms_server.placement.state import Array

_MAGIC = b"TMS placement state 1\n"
_DIGEST = 16
_TYPES = {"<i4": np.int32, "<f8": np.float64, "<u8": np.uint64}


def pack(kind: str, header: Mapping[str, Any], arrays: Mapping[str, Array]) -> bytes:
    """One state as bytes. ``arrays``: int32, float64 or uint64 of any shape."""
    index = {}
    body = []
    for name, array in arrays.items():
        code = {"i": "<i4", "f": "<f8", "u": "<u8"}[array.dtype.kind]
        index[name] = [code, list(array.shape)]
        body.append(np.ascontiguousarray(array, code).tobytes())
    head = json.dumps(
        {"kind": kind, "arrays": index, "state": header}, sort_keys=False, ensure_ascii=False, allow_nan=False
    ).encode()
    data = b"".join([_MAGIC, len(head).to_bytes(8, "little"), head, *body])
    return data + hashlib.blake2b(data, digest_size=_DIGEST).digest()


def unpack(kind: str, data: bytes) -> tuple[dict[str, Any], dict[str, Array]]:
    """Header and arrays of a state. ValueError if it is damaged, or not of this kind and version."""
    if not data.startswith(_MAGIC):
        raise ValueError("not a placement state of this version")
    content, digest = data[:-_DIGEST], data[-_DIGEST:]
    if hashlib.blake2b(content, digest_size=_DIGEST).digest() != digest:
        raise ValueError("the placement state is damaged (checksum)")
    at = len(_MAGIC) + 8
    size = int.from_bytes(content[at - 8 : at], "little")
    head = json.loads(content[at : at + size])
    if head["kind"] != kind:
        raise ValueError(f"the state is of a {head['kind']} filter, not {kind}")
    at += size
    arrays: dict[str, Array] = {}
    for name, (code, shape) in head["arrays"].items():
        count = int(np.prod(shape, dtype=np.int64))
        values = np.frombuffer(content, code, count, at)
        arrays[name] = values.astype(_TYPES[code]).reshape(shape)
        at += values.nbytes
    return head["state"], arrays
