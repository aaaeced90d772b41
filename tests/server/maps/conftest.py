"""A room with a map in it."""

from __future__ import annotations

import httpx
import numpy as np
import pytest
from map_robot import MAP, ROOM, Robot


@pytest.fixture
async def robot(http: httpx.AsyncClient) -> Robot:
    (await http.put("/v1/rooms/lab", json=ROOM)).raise_for_status()
    (await http.put("/v1/maps/corridor", json=MAP)).raise_for_status()
    return Robot(http)


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(5)
