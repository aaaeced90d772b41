"""A town with two rooms and a small catalogue, and tags that agents saw."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

import httpx
import pytest

from tms_server.db.session import Sessions
from tms_server.db.tables import UnknownTagRow

SQUARE = [[0, 0], [4, 0], [4, 3], [0, 3]]
TEA = "4901234567894"


@pytest.fixture
async def town(http: httpx.AsyncClient) -> httpx.AsyncClient:
    for room in ("lab", "kitchen"):
        assert (await http.put(f"/v1/rooms/{room}", json={"name": room, "outline": SQUARE})).status_code == 201
    tea = {
        "name": "お茶 500ml",
        "size_m": [0.06, 0.08, 0.2],
        "weight_g": 520,
        "weight_sd_g": 4,
        "category": "飲み物",
        "shape": {"class": "bottle", "polygon": [[0, 0], [0.06, 0], [0, 0.06]]},
    }
    assert (await http.put(f"/v1/products/{TEA}", json=tea)).status_code == 201
    return http


@pytest.fixture
def see(sessions: Sessions) -> Callable[..., Awaitable[None]]:
    """What an agent's reads of an unknown tag leave behind."""

    async def read(tag: str, room: str, *, count: int = 1, first: int = 1_000_000, last: int = 2_000_000) -> None:
        async with sessions.write() as session:
            session.add(
                UnknownTagRow(
                    tag=tag, room=room, agent="hand", first_seen=first, last_seen=last, count=count, x=1.0, y=2.0
                )
            )
            await session.commit()

    return read
