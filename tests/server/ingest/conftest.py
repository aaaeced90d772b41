"""A room to post into, and the shape of a batch."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest

Post = Callable[..., Awaitable[httpx.Response]]


@pytest.fixture
async def post(http: httpx.AsyncClient) -> Post:
    """``await post(observation, ..., agent="cab")`` into the room ``lab``, which exists."""
    outline = [[0, 0], [8, 0], [8, 6], [0, 6]]
    made = await http.put("/v1/rooms/lab", json={"name": "Lab", "outline": outline})
    assert made.status_code in (200, 201), made.text

    async def send(*observations: dict[str, Any], agent: str = "cab", room: str = "lab") -> httpx.Response:
        body = {"agent": agent, "room": room, "observations": list(observations)}
        return await http.post("/v1/observations", json=body)

    return send


@pytest.fixture
def seen() -> Callable[..., dict[str, Any]]:
    """An observation: a label that appeared, unless told otherwise."""

    def observation(seq: int, **fields: Any) -> dict[str, Any]:
        base: dict[str, Any] = {"seq": seq, "observed_at": f"2026-05-01T10:00:{seq % 60:02d}Z"}
        if "type" not in fields:
            base |= {"type": "label_appeared", "label": f"cab/{seq}", "kind": "cabinet", "xy": [1.0, 2.0]}
        return {**base, **fields}

    return observation
