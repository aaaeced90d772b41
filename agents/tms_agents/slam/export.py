"""Results as files: trajectory, ROS map_server image and description, picture, arrays."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from tms_agents.slam.geometry import Bytes, Floats
from tms_agents.slam.gridmap import GridMap
from tms_agents.slam.light.gridlight import GridLight

OCCUPIED, FREE = 0.65, 0.196
_COLOURS = ((0, 0, 0), (220, 30, 30), (30, 60, 220))
#: From dark to bright, all told apart from the grey around them.
_SHADES = ((20, 10, 70), (110, 20, 120), (200, 50, 70), (245, 130, 20), (255, 225, 60))
_GREY = {"free": 254, "unknown": 205, "occupied": 0}


def write_trajectory(path: Path, t: Floats, poses: Floats) -> None:
    """Lines ``t x y theta``, one per scan."""
    with path.open("w", encoding="ascii") as file:
        file.write("# timestamp x y theta\n")
        for time, (x, y, theta) in zip(t, poses, strict=True):
            file.write(f"{time:.6f} {x:.6f} {y:.6f} {theta:.8f}\n")


def write_map(folder: Path, grid: GridMap, path: Floats, light: GridLight | None = None) -> None:
    """``map.pgm`` + ``map.yaml`` (trinary), ``map_raw.pgm`` + ``map_raw.yaml``, ``map.npy``, ``map.npz`` and
    ``map.png``.

    ``path`` (K, 3) of the robot is drawn into the picture. With ``light`` also ``imap.npy`` and ``imap.png``, and its
    layers in ``map.npz``.
    """
    layers: dict[str, Any] = {}
    if light is not None:
        layers = {"light_mean": light.mean, "light_variance": light.variance, "light_count": light.count}
        np.save(folder / "imap.npy", light.reflectance().astype(np.float32))
        Image.fromarray(light_picture(grid, light)[::-1]).save(folder / "imap.png")
    probabilities = grid.probabilities()
    unknown = np.isnan(probabilities)
    np.save(folder / "map.npy", probabilities.astype(np.float32))
    np.savez_compressed(
        folder / "map.npz",
        occupancy=probabilities.astype(np.float32),
        log_odds=grid.cells,
        origin=np.array(grid.origin),
        resolution=grid.resolution,
        path=path,
        **layers,
    )
    trinary = _trinary(probabilities)
    Image.fromarray(trinary[::-1]).save(folder / "map.pgm")
    _write_yaml(folder / "map.yaml", "map.pgm", grid, "trinary")
    raw = np.where(unknown, 255, np.round(100 * np.where(unknown, 0.0, probabilities))).astype(np.uint8)
    Image.fromarray(raw[::-1]).save(folder / "map_raw.pgm")
    _write_yaml(folder / "map_raw.yaml", "map_raw.pgm", grid, "raw")
    Image.fromarray(map_picture(probabilities, grid.origin, grid.resolution, path)).save(folder / "map.png")


def map_picture(occupancy: Floats, origin: tuple[float, float], resolution: float, path: Floats) -> Bytes:
    """(H, W, 3) of ``occupancy`` (H, W; row 0 lowest, NaN unknown) with ``path`` (K, 2 or more), its first row on
    top. Where ``path`` is NaN the pen is lifted."""
    picture = np.repeat(_trinary(occupancy)[:, :, None], 3, axis=2)
    if np.isfinite(path).any():
        _draw(picture, (path[:, :2] - np.array(origin)) / resolution)
    return picture[::-1]


def light_picture(grid: GridMap, light: GridLight) -> Bytes:
    """(H, W, 3), row 0 lowest: surfaces from dark blue (dark) to yellow (bright) on grey."""
    probabilities = grid.probabilities()
    picture = np.full((*grid.cells.shape, 3), _GREY["unknown"], dtype=np.uint8)
    with np.errstate(invalid="ignore"):
        picture[probabilities < 0.5] = _GREY["free"]
        surface = (probabilities > OCCUPIED) & np.isfinite(light.mean)
    if surface.any():
        darkest, brightest = np.quantile(light.mean[surface], [0.02, 0.98])
        share = np.clip((light.mean[surface] - darkest) / max(0.2, brightest - darkest), 0.0, 1.0)
        stops = np.linspace(0.0, 1.0, len(_SHADES))
        shades = np.array(_SHADES, dtype=np.float64)
        picture[surface] = np.stack([np.interp(share, stops, shades[:, c]) for c in range(3)], axis=-1)
    return picture


def paths_picture(paths: list[Floats], pixels: int = 900) -> Bytes:
    """(H, W, 3) of paths (K, 2) m in one frame on white, each in a colour of its own (black, red, blue ...)."""
    every = np.concatenate(paths)
    lowest, span = every.min(axis=0), float(np.ptp(every, axis=0).max())
    resolution = max(span, 1.0) / (pixels - 20)
    width, height = (int(s / resolution) + 20 for s in np.ptp(every, axis=0))
    picture = np.full((height, width, 3), 255, dtype=np.uint8)
    for number, path in enumerate(paths):
        places = _places((path - lowest) / resolution + 10)
        picture[places[:, 1].clip(0, height - 1), places[:, 0].clip(0, width - 1)] = _COLOURS[number % len(_COLOURS)]
    return picture[::-1]


def _places(cells: Floats) -> NDArray[np.int64]:
    """(P, 2) every cell on the lines between ``cells`` (K, 2)."""
    pieces = [cells[:1]]
    for a, b in itertools.pairwise(cells):
        pieces.append(a + (b - a) * np.linspace(0, 1, 2 + int(np.abs(b - a).max()))[:, None])
    return np.concatenate(pieces).astype(np.int64)


def _trinary(occupancy: Floats) -> Bytes:
    """The grey values that ``map_server`` reads as free, occupied and unknown."""
    grey = np.full(occupancy.shape, _GREY["unknown"], dtype=np.uint8)
    grey[occupancy < 0.5] = _GREY["free"]
    grey[occupancy > OCCUPIED] = _GREY["occupied"]
    return grey


def _draw(picture: Bytes, cells: Floats) -> None:
    """The path ``cells`` (K, 2), a pixel wide, from blue to red."""
    lifted = np.flatnonzero(np.isnan(cells).any(axis=1))
    runs = [run[np.isfinite(run).all(axis=1)] for run in np.split(cells, lifted)]
    places = np.concatenate([_places(run) for run in runs if len(run)])
    share = np.linspace(0.0, 1.0, len(places))
    inside = ((places >= 0) & (places < np.array(picture.shape[1::-1]))).all(axis=1)
    colours = np.stack([255 * share, 0 * share + 60, 255 * (1 - share)], axis=-1).astype(np.uint8)
    picture[places[inside, 1], places[inside, 0]] = colours[inside]


def _write_yaml(path: Path, image: str, grid: GridMap, mode: str) -> None:
    lines = [
        f"image: {image}",
        f"mode: {mode}",
        f"resolution: {grid.resolution:g}",
        f"origin: [{grid.origin[0]:.6f}, {grid.origin[1]:.6f}, 0.0]",
        "negate: 0",
        f"occupied_thresh: {OCCUPIED}",
        f"free_thresh: {FREE}",
    ]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
