"""A reader of ROS maps, written from the documentation of ``map_server`` (map_format) and from nothing of ours.

"image: path to the image file; resolution: metres / pixel; origin: the 2-D pose of the lower-left pixel in the map, as
(x, y, yaw); occupied_thresh: pixels with occupancy probability greater than this are considered completely occupied;
free_thresh: pixels with occupancy probability less than this are considered completely free; negate: whether the
white/black free/occupied semantics should be reversed." Trinary: p = (255 - x) / 255, 100 over the one threshold, 0
under the other, else -1. Raw: x is the value, and what is not in 0..100 is unknown. ``OccupancyGrid`` data is in
row-major order, starting with the cell at the origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import yaml


@dataclass
class OccupancyGrid:
    resolution: float
    origin: tuple[float, float, float]
    #: (height, width), row 0 has the lowest y; -1, or 0 to 100.
    data: np.ndarray

    def at(self, x: float, y: float) -> int:
        """Of the cell that holds the place (x, y)."""
        column = int(np.floor((x - self.origin[0]) / self.resolution))
        row = int(np.floor((y - self.origin[1]) / self.resolution))
        return int(self.data[row, column])


def load(description: str, image: bytes) -> OccupancyGrid:
    fields = yaml.safe_load(description)
    assert isinstance(fields["resolution"], float) and all(isinstance(one, float) for one in fields["origin"])
    assert len(fields["origin"]) == 3 and fields["negate"] in (0, 1)
    pixels = netpbm(image).astype(int)
    upright = pixels[::-1]
    if fields["mode"] == "raw":
        data = np.where((upright >= 0) & (upright <= 100), upright, -1)
    else:
        assert fields["mode"] == "trinary"
        p = upright / 255.0 if fields["negate"] else (255 - upright) / 255.0
        data = np.full(p.shape, -1)
        data[p > fields["occupied_thresh"]] = 100
        data[p < fields["free_thresh"]] = 0
    return OccupancyGrid(fields["resolution"], tuple(fields["origin"]), data)


def netpbm(image: bytes) -> np.ndarray:
    """A binary PGM of at most 8 bits, as netpbm's pgm(5) has it."""
    magic, width, height, most, *_ = image.split(maxsplit=4)
    assert magic == b"P5" and int(most) == 255
    head = len(magic) + len(width) + len(height) + len(most) + 4
    size = int(width) * int(height)
    assert len(image) == head + size
    return np.frombuffer(image, np.uint8, size, head).reshape(int(height), int(width))
