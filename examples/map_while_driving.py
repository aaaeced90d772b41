"""A robot maps two rooms and a corridor, and sends what changed while it drives; then a door is closed.

Start a server in one terminal, and this in another one::

    tms serve
    python examples/map_while_driving.py --url http://127.0.0.1:8080

The world and the laser are simulated here, in a few lines; the robot knows where it is (a mapper such as ``tms slam
run`` estimates it). What a robot needs of the Town Management System is in ``main``: ``town.maps.put`` once,
``town.maps.upload`` as it goes, and for other robots ``town.map`` and its ``update``.
"""

from __future__ import annotations

import argparse
import itertools

import numpy as np
import numpy.typing as npt

from tms_client import Town
from tms_client.maps.cells import Intensity
from tms_schemas.maps import MapIn, MapObject
from tms_schemas.rooms import RoomIn

Floats = npt.NDArray[np.float64]
RESOLUTION, WIDTH_M, HEIGHT_M = 0.05, 14.0, 9.0
#: x0, y0, x1, y1 in metres, and how brightly it reflects: walls, a cabinet, a bed, a red bin.
WALLS = [
    *((0, 0, 14, 0.15, 400), (0, 8.85, 14, 9, 400), (0, 0, 0.15, 9, 400), (13.85, 0, 14, 9, 400)),
    *((0, 3.5, 2, 3.6, 400), (3, 3.5, 8, 3.6, 700), (9, 3.5, 14, 3.6, 400), (7, 0, 7.1, 3.5, 400)),
    *((0, 5.6, 5.5, 5.7, 400), (6.5, 5.6, 14, 5.7, 250)),
    *((0.3, 0.2, 1.9, 0.7, 900), (4.5, 1.0, 6.6, 2.0, 150), (11.0, 6.9, 12.5, 7.7, 550), (12.9, 3.8, 13.3, 4.2, 80)),
]
DOOR = (8.0, 3.5, 9.0, 3.6, 1000)
PATH = [(1.0, 4.6), (2.5, 4.6), (2.5, 2.0), (3.6, 2.6), (2.5, 2.6), (2.5, 4.6), (6.0, 4.6), (6.0, 7.5), (9.5, 7.8),
        (6.0, 7.5), (6.0, 4.6), (8.5, 4.6), (8.5, 1.8), (11.5, 1.8), (8.5, 2.0), (8.5, 4.6), (12.0, 4.6)]  # fmt: skip
REACH_M, BEAMS = 8.0, 540


class Mapper:
    """Occupancy by log-odds, and mean and variance of the light that came back, over one grid."""

    def __init__(self) -> None:
        shape = (round(HEIGHT_M / RESOLUTION), round(WIDTH_M / RESOLUTION))
        self.log_odds, self.seen = np.zeros(shape), np.zeros(shape, dtype=bool)
        self.count, self.mean, self.squares = np.zeros(shape, dtype=np.uint32), np.zeros(shape), np.zeros(shape)

    def add(self, x: float, y: float, angles: Floats, ranges: Floats, light: Floats) -> None:
        steps = np.arange(0, REACH_M, RESOLUTION / 2)
        before = steps[None, :] < np.minimum(ranges, REACH_M)[:, None] - RESOLUTION
        free = np.zeros(self.seen.shape, dtype=bool)
        free[_cells(x, y, angles[:, None], np.broadcast_to(steps, before.shape), before)] = True
        hit = ranges < REACH_M
        at = _cells(x, y, angles, ranges + RESOLUTION / 4, hit)
        free[at] = False
        self.log_odds[free] -= 0.5
        np.add.at(self.log_odds, at, 0.4)
        self.log_odds.clip(-5, 5, out=self.log_odds)
        self.seen |= free
        self.seen[at] = True
        for row, column, value in zip(*at, light[hit], strict=True):  # Welford's running mean and variance
            self.count[row, column] += 1
            step = value - self.mean[row, column]
            self.mean[row, column] += step / self.count[row, column]
            self.squares[row, column] += step * (value - self.mean[row, column])

    def arrays(self) -> tuple[Floats, Intensity]:
        occupancy = np.where(self.seen, 1 / (1 + np.exp(-self.log_odds)), np.nan)
        variance = self.squares / np.maximum(self.count, 1)
        return occupancy, Intensity(self.mean.astype(np.float32), variance.astype(np.float32), self.count)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--url", default="http://127.0.0.1:8080")
    parser.add_argument("--key")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    random, mapper = np.random.default_rng(arguments.seed), Mapper()
    with Town(arguments.url, arguments.key) as town:
        outline = [(0.0, 0.0), (WIDTH_M, 0.0), (WIDTH_M, HEIGHT_M), (0.0, HEIGHT_M)]
        town.rooms.put("ward", RoomIn(name="Ward", outline=outline))
        town.maps.put("ward", MapIn(room="ward", name="the ward", resolution=RESOLUTION, map_to_room=(0, 0, 0)))
        other = town.map("ward")  # another robot, which follows
        for state, world in (("open", _world()), ("closed", _world(DOOR))):
            door = MapObject(tag="E00401504D4F4F52", x=8.5, y=3.55, theta=0, state=state)
            for number, (x, y) in enumerate(_poses(PATH if state == "open" else [(5.5, 4.6), (11.5, 4.6)])):
                mapper.add(x, y, *_scan(world, x, y, random))
                if number % 30 == 29:
                    occupancy, light = mapper.arrays()
                    made = town.maps.upload(
                        "ward",
                        occupancy,
                        (0.0, 0.0),
                        agent="robot",
                        intensity=light,
                        objects=[door],
                        note=f"door {state}",
                    )
                    other.update()
                    known = np.count_nonzero(~np.isnan(other.occupancy)) * RESOLUTION**2
                    print(f"version {made.version}: {made.changed:2} tiles changed, {known:5.1f} m2 known")
        opened = max(one.version for one in town.maps.versions("ward") if one.note == "door open")
        diff = town.maps.diff("ward", opened)
        moved = ", ".join(f"{one.tag} {one.after.state}" for one in diff.objects if one.after)
        print(f"since version {diff.before}: {diff.became_occupied} cells became occupied; {moved}")


def _world(*more: tuple[float, ...]) -> Floats:
    """How brightly each cell reflects; 0 is empty space."""
    cells = np.zeros((round(HEIGHT_M / RESOLUTION), round(WIDTH_M / RESOLUTION)))
    for x0, y0, x1, y1, light in (*WALLS, *more):
        row0, row1, column0, column1 = (round(side / RESOLUTION) for side in (y0, y1, x0, x1))
        cells[row0:row1, column0:column1] = light
    return cells


def _scan(world: Floats, x: float, y: float, random: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """Angles, ranges (``REACH_M`` without an echo) and light of one turn of the laser."""
    angles = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False)
    steps = np.arange(0, REACH_M, RESOLUTION / 4)
    everywhere = np.ones((BEAMS, len(steps)), dtype=bool)
    light = world[_cells(x, y, angles[:, None], np.broadcast_to(steps, everywhere.shape), everywhere)]
    light = light.reshape(everywhere.shape)
    first = (light > 0).argmax(axis=1)
    hit = light[np.arange(BEAMS), first] > 0
    ranges = np.where(hit, steps[first] + random.normal(0, 0.01, BEAMS), REACH_M)
    return angles, ranges, light[np.arange(BEAMS), first] * random.normal(1, 0.05, BEAMS)


def _cells(
    x: float, y: float, angles: Floats, ranges: Floats, wanted: npt.NDArray[np.bool_]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Rows and columns of the ends of the wanted beams."""
    columns = ((x + ranges * np.cos(angles))[wanted] / RESOLUTION).astype(int)
    rows = ((y + ranges * np.sin(angles))[wanted] / RESOLUTION).astype(int)
    return rows.clip(0, round(HEIGHT_M / RESOLUTION) - 1), columns.clip(0, round(WIDTH_M / RESOLUTION) - 1)


def _poses(corners: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Every 10 cm along the way."""
    return [
        (float(x0 + share * (x1 - x0)), float(y0 + share * (y1 - y0)))
        for (x0, y0), (x1, y1) in itertools.pairwise(corners)
        for share in np.arange(0, 1, 0.1 / np.hypot(x1 - x0, y1 - y0))
    ]


if __name__ == "__main__":
    main()
