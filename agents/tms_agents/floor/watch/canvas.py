"""A small picture of dots: drawn once, shown as a PNG file or, with a dot per braille point, in a terminal."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Xy = tuple[float, float]
#: Digits and a few letters, five rows of three dots, as numbers in octal.
_GLYPHS = {
    "0": 0o75557, "1": 0o26227, "2": 0o71747, "3": 0o71717, "4": 0o55711, "5": 0o74717, "6": 0o74757, "7": 0o71244,
    "8": 0o75757, "9": 0o75717, ".": 0o00002, "m": 0o00775, " ": 0o00000, "-": 0o00700,
}  # fmt: skip
#: Bits of a braille character by row and column of its dots.
_BRAILLE = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], dtype=np.int64)


class Canvas:
    """``dots`` (height, width) holds a colour's number per dot, 0 for none; the frame is in metres, y upwards.

    ``frame`` is (x0, y0, x1, y1); it is widened to the shape of the canvas, a metre is as long in both directions.
    """

    def __init__(self, width: int, height: int, frame: tuple[float, float, float, float]) -> None:
        self.dots: NDArray[np.uint8] = np.zeros((max(1, height), max(1, width)), np.uint8)
        x0, y0, x1, y1 = frame
        self.scale = min(width / max(x1 - x0, 0.1), height / max(y1 - y0, 0.1))
        self._x0 = (x0 + x1) / 2 - width / self.scale / 2
        self._y1 = (y0 + y1) / 2 + height / self.scale / 2

    def points(self, points: Iterable[Sequence[float]], colour: int, size: int = 1) -> None:
        """``size`` dots wide and high each."""
        if not len(xy := np.array(list(points), dtype=np.float64).reshape(-1, 2)):
            return
        with np.errstate(invalid="ignore"):
            column = np.floor((xy[:, 0] - self._x0) * self.scale - (size - 1) / 2)
            row = np.floor((self._y1 - xy[:, 1]) * self.scale - (size - 1) / 2)
        for down in range(size):
            for right in range(size):
                self._set(column + right, row + down, colour)

    def line(
        self, points: Sequence[Sequence[float]], colour: int, *, closed: bool = False, dashed: bool = False
    ) -> None:
        ends = [*points, points[0]] if closed and len(points) else list(points)
        for (xa, ya), (xb, yb) in pairwise(ends):
            count = int(min(np.hypot(xb - xa, yb - ya) * self.scale * 1.5, 10_000)) + 2
            share = np.linspace(0, 1, count)
            if dashed:
                share = share[np.arange(count) % 9 < 4]
            self.points(np.stack([xa + share * (xb - xa), ya + share * (yb - ya)], axis=1).tolist(), colour)

    def ring(self, xy: Sequence[float], radius_m: float, colour: int, *, filled: bool = False) -> None:
        count = max(12, int(7 * radius_m * self.scale))
        turn = np.linspace(0, 2 * np.pi, count)
        for radius in np.arange(radius_m, 0, -0.7 / self.scale) if filled else [radius_m]:
            ring = np.stack([xy[0] + radius * np.cos(turn), xy[1] + radius * np.sin(turn)], axis=1)
            self.points(ring.tolist(), colour)

    def text(self, xy: Sequence[float], text: str, colour: int, size: int = 1) -> None:
        """Digits, beginning right of and above a point."""
        left, low = (xy[0] - self._x0) * self.scale, (self._y1 - xy[1]) * self.scale
        for n, one in enumerate(text):
            bits = _GLYPHS.get(one, 0)
            for row in range(5):
                for column in range(3):
                    if bits >> (3 * (4 - row) + 2 - column) & 1:
                        x, y = left + (4 * n + column) * size, low + (row - 5) * size
                        for d in range(size * size):
                            self._set(np.array([x + d % size]), np.array([y + d // size]), colour)

    def png(self, palette: Sequence[tuple[int, int, int]]) -> bytes:
        """A file; ``palette`` gives the colours, that of the ground first."""
        image = Image.fromarray(self.dots)
        image.putpalette([value for colour in palette for value in colour])
        file = io.BytesIO()
        image.save(file, "PNG", optimize=True)
        return file.getvalue()

    def braille(self) -> list[list[tuple[str, int]]]:
        """Rows of characters with the number of their colour: of several colours in a character the highest."""
        height, width = (self.dots.shape[0] + 3) // 4, (self.dots.shape[1] + 1) // 2
        padded = np.zeros((height * 4, width * 2), np.uint8)
        padded[: self.dots.shape[0], : self.dots.shape[1]] = self.dots
        cells = padded.reshape(height, 4, width, 2).transpose(0, 2, 1, 3)
        bits = ((cells > 0) * _BRAILLE).sum(axis=(2, 3))
        colour = cells.max(axis=(2, 3))
        return [
            [(chr(0x2800 + int(bits[row, n])) if bits[row, n] else " ", int(colour[row, n])) for n in range(width)]
            for row in range(height)
        ]

    def _set(self, column: NDArray[np.float64], row: NDArray[np.float64], colour: int) -> None:
        height, width = self.dots.shape
        with np.errstate(invalid="ignore"):
            inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        self.dots[row[inside].astype(np.int64), column[inside].astype(np.int64)] = colour
