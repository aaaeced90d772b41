"""What a robot sends of its map, for tests of the server."""

from __future__ import annotations

from typing import Any

import httpx
import numpy as np

from tms_schemas.tiles import SIDE, UNKNOWN, Planes, pack, to_text

ROOM = {"name": "Lab", "outline": [[0, 0], [9, 0], [9, 9], [0, 9]]}
MAP = {"room": "lab", "resolution": 0.05, "origin": [-1.0, 2.0], "name": "the corridor", "map_to_room": [1, 2, 0.5]}


class Robot:
    """Sends versions of the map ``corridor``."""

    def __init__(self, http: httpx.AsyncClient) -> None:
        self.http = http

    async def send(self, base: int, tiles: dict[tuple[int, int], Any] | None = None, **more: Any) -> httpx.Response:
        sent = [
            {"x": x, "y": y} | ({"digest": one} if isinstance(one, str) else {"data": text(one)})
            for (x, y), one in (tiles or {}).items()
        ]
        body = {"base": base, "agent": "robot", "tiles": sent} | more
        return await self.http.post("/v1/maps/corridor/versions", json=body)

    async def tiles(self, **params: Any) -> dict[tuple[int, int], str | None]:
        page = (await self.http.get("/v1/maps/corridor/tiles", params=params)).json()
        return {(one["x"], one["y"]): one["data"] for one in page["tiles"]}


def tile(*cells: tuple[int, int, int], fill: int = UNKNOWN) -> Planes:
    """A tile with these (column, row, stored occupancy)."""
    occupancy = np.full((SIDE, SIDE), fill, dtype=np.uint8)
    for x, y, value in cells:
        occupancy[y, x] = value
    return Planes(occupancy.tobytes())


def measured(cell: tuple[int, int], mean: float, variance: float, count: int) -> Planes:
    """A tile whose intensity was measured in one cell (column, row)."""
    means, variances = np.zeros((2, SIDE, SIDE), dtype="<f4")
    counts = np.zeros((SIDE, SIDE), dtype="<u4")
    x, y = cell
    means[y, x], variances[y, x], counts[y, x] = mean, variance, count
    return Planes(bytes([UNKNOWN]) * SIDE * SIDE, means.tobytes() + variances.tobytes() + counts.tobytes())


def text(planes: Planes) -> str:
    return to_text(pack(planes))
