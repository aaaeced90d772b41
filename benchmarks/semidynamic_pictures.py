"""Maps before and after things were moved, with arrows where the tags are, as in the paper's figures 2 and 3."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from tms_agents.slam.geometry import Floats, compose
from tms_agents.slam.semidynamic import Models, Semidynamic

_PIXELS_PER_M, _ARROW_M, _MARGIN_M = 50, 0.5, 0.4
_RED, _BLACK = (210, 30, 30), (0, 0, 0)


def panels(path: Path, models: Models, shown: Sequence[tuple[str, Semidynamic]]) -> None:
    """A map below the other, all over the same area, each below its caption."""
    corners = [np.array(one.grid.origin) for _, one in shown]
    ends = [
        at + np.array(one.grid.cells.shape[::-1]) * one.grid.resolution
        for at, (_, one) in zip(corners, shown, strict=True)
    ]
    low, high = np.min(corners, axis=0) - _MARGIN_M, np.max(ends, axis=0) + _MARGIN_M
    drawn = [_panel(caption, one, models, low, high) for caption, one in shown]
    whole = Image.new("RGB", (drawn[0].width, sum(one.height for one in drawn)), "white")
    for number, one in enumerate(drawn):
        whole.paste(one, (0, number * one.height))
    whole.save(path)


def _panel(caption: str, result: Semidynamic, models: Models, low: Floats, high: Floats) -> Image.Image:
    width, height = np.ceil((high - low) * _PIXELS_PER_M).astype(int)
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    grid = result.grid
    at = np.floor((np.stack([x, y], axis=-1) / _PIXELS_PER_M + low - np.array(grid.origin)) / grid.resolution).astype(
        int
    )
    inside = ((at >= 0) & (at < np.array(grid.cells.shape[::-1]))).all(axis=-1)
    told = np.full((height, width), np.nan)
    told[inside] = grid.probabilities()[at[inside, 1], at[inside, 0]]
    grey = np.where(np.isnan(told), 205, 255 - 255 * np.nan_to_num(told)).astype(np.uint8)
    image = Image.fromarray(grey[::-1]).convert("RGB")
    pen = ImageDraw.Draw(image)
    pen.text((8, 4), caption, fill=_BLACK)
    for tag, stays in result.stays.items():
        pose = compose(stays[-1].pose, models.objects[tag].tag)
        _arrow(pen, pose, low, height)
    return image


def _arrow(pen: ImageDraw.ImageDraw, pose: Floats, low: Floats, height: int) -> None:
    """From a tag along the normal of its face."""

    def pixel(along: float, aside: float) -> tuple[float, float]:
        x, y, _ = compose(pose, np.array([along, aside, 0.0]))
        return float((x - low[0]) * _PIXELS_PER_M), float(height - 1 - (y - low[1]) * _PIXELS_PER_M)

    pen.line([pixel(0, 0), pixel(_ARROW_M, 0)], fill=_RED, width=2)
    pen.polygon([pixel(_ARROW_M + 0.1, 0), pixel(_ARROW_M - 0.05, 0.08), pixel(_ARROW_M - 0.05, -0.08)], fill=_RED)
