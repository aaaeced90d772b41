"""Maps in the files of ROS ``map_server``: YAML and an image (PGM, PNG, BMP) whose first row is the top of the map."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import yaml
from PIL import Image

from tms_client.errors import TownError
from tms_client.maps.cells import Floats

#: Pixels of an image: more is a mistake.
_MOST = 2**26


class Grid(NamedTuple):
    """``occupancy`` (H, W): probability, NaN unknown, row 0 with the lowest y, whose left corner is ``origin``."""

    occupancy: Floats
    resolution: float
    origin: tuple[float, float]


def read_map(path: Path) -> Grid:
    """The map that a YAML file describes, in any of the modes trinary, scale and raw.

    Raises:
        TownError: a file cannot be read, or is no such map.
    """
    fields = _description(path)
    try:
        x, y, yaw = (float(one) for one in fields["origin"])
        resolution = float(fields["resolution"])
        negate = float(fields.get("negate", 0)) != 0
        occupied, free = float(fields.get("occupied_thresh", 0.65)), float(fields.get("free_thresh", 0.196))
        image, mode = str(fields["image"]), str(fields.get("mode", "trinary")).lower()
    except KeyError as error:
        raise TownError(f"{path}: it has no {error.args[0]}") from None
    except (TypeError, ValueError, OverflowError) as error:
        raise TownError(f"{path}: {error}") from None
    if not (math.isfinite(x) and math.isfinite(y) and 0 < resolution < math.inf):
        raise TownError(f"{path}: resolution and origin must be finite, the resolution positive")
    if abs(yaw) > 1e-9:
        raise TownError(f"{path}: the origin is turned by {yaw:g} rad; only maps that are not turned can be taken")
    pixels, full = read_image(path.parent / image)
    if mode == "raw":
        if full != 255:
            raise TownError(f"{path}: a raw map needs an image of 255 grey levels, not {full}")
        occupancy = np.where(pixels <= 100, pixels / 100, np.nan)
    elif mode in ("trinary", "scale"):
        p = pixels / full if negate else 1 - pixels / full
        between = (p - free) / (occupied - free) if mode == "scale" and occupied > free else np.full(p.shape, np.nan)
        occupancy = np.where(p > occupied, 1.0, np.where(p < free, 0.0, between))
    else:
        raise TownError(f"{path}: mode {mode[:60]!r} is none of trinary, scale and raw")
    return Grid(occupancy[::-1].astype(np.float32), resolution, (x, y))


def read_image(path: Path) -> tuple[npt.NDArray[np.float64], int]:
    """Grey levels (H, W), first row on top, and the one that is white: 255, or 65535 where the file has more.

    Raises:
        TownError: the file cannot be read, or is no image of the kinds that ``map_server`` writes.
    """
    try:
        with Image.open(path, formats=("PPM", "PNG", "BMP")) as image:
            if image.width * image.height > _MOST:
                raise TownError(f"{path}: an image of {image.width} x {image.height} pixels is too large")
            deep = image.mode.startswith("I")
            return np.asarray(image if deep else image.convert("L"), dtype=np.float64), 65535 if deep else 255
    except _NO_IMAGE as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else "this is no image, or not all of it"
        raise TownError(f"{path}: {why}") from error


#: What Pillow raises for files that are no image, or are damaged.
_NO_IMAGE = (
    *(OSError, SyntaxError, ValueError, EOFError, OverflowError),
    *(Image.DecompressionBombError, Image.DecompressionBombWarning),
)


def _description(path: Path) -> dict[str, Any]:
    """Keys and values. Raises ``TownError``."""
    try:
        found = yaml.safe_load(path.read_bytes())
    except OSError as error:
        raise TownError(f"{path}: {error.strerror}") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        where = "" if mark is None else f" (line {mark.line + 1})"
        raise TownError(f"{path}: this is no YAML{where}") from error
    if not isinstance(found, dict):
        raise TownError(f"{path}: it has no keys and values")
    return found
