"""Files of a version: the image and description that ``map_server`` of ROS reads, and pictures for people.

ROS: the first row of the image is the top of the map; ``origin`` is the lower left corner. ``trinary`` writes 0 for
occupied, 254 for free, 205 for unknown; ``raw`` writes the probability in per cent, 255 for unknown.
"""

from __future__ import annotations

import io

import numpy as np
import numpy.typing as npt
from PIL import Image

from tms_schemas.maps import PgmMode, TownMap
from tms_schemas.tiles import FULL, UNKNOWN
from tms_server.errors import Invalid
from tms_server.maps.cells import FREE, OCCUPIED, Bounds, Bytes, Cells, Raster, free, occupied
from tms_server.maps.content import MAX_CELLS
from tms_server.maps.differences import kinds

_GREY_UNKNOWN = 205
Palette = npt.NDArray[np.uint8]
#: Colours of ``differences.kinds``, told apart by colour-blind people too.
_BECAME = {1: (213, 45, 0), 2: (0, 110, 200), 3: (255, 214, 90), 4: (170, 110, 190)}


def pgm(cells: Cells, mode: PgmMode) -> bytes:
    """``cells`` are stored occupancy."""
    if mode == "raw":
        values = np.round(np.arange(256) * (100 / FULL)).astype(np.uint8)
        values[UNKNOWN] = 255
        image = values[cells.values]
    else:
        image = np.full(cells.values.shape, _GREY_UNKNOWN, dtype=np.uint8)
        image[free(cells.values)] = 254
        image[occupied(cells.values)] = 0
    return _file(Image.fromarray(image[::-1]), "PPM")


def yaml(map: TownMap, version: int, bounds: Bounds | None, mode: PgmMode) -> str:
    """The description beside ``<map>.pgm``."""
    x, y = (one + map.resolution * cell for one, cell in zip(map.origin, bounds or (0, 0), strict=False))
    pose = map.map_to_room
    frame = "unknown" if pose is None else f"x {pose[0]:.6g} m, y {pose[1]:.6g} m, {pose[2]:.6g} rad"
    return "\n".join(
        (
            f"# map {map.id} of room {map.room}, version {version}; pose of the map frame in the room: {frame}",
            f"image: {map.id}.pgm",
            f"mode: {mode}",
            f"resolution: {map.resolution!r}",
            f"origin: [{_number(x)}, {_number(y)}, 0.0]",
            "negate: 0",
            f"occupied_thresh: {OCCUPIED}",
            f"free_thresh: {FREE}",
            "",
        )
    )


def occupancy_png(cells: Cells) -> bytes:
    """The darker the more probably occupied; what is unknown is bluish."""
    return _png(cells.values, _shades())


def intensity_png(cells: Cells) -> bytes:
    """From black (the least) to white (the most, but one in a hundred cells); bluish where nothing was measured."""
    values = cells.values
    measured = np.isfinite(values)
    shades = np.full(values.shape, UNKNOWN, dtype=np.uint8)
    if measured.any():
        least, most = np.percentile(values[measured], (0, 99))
        share = (values[measured] - least) / max(float(most - least), 1e-12)
        shades[measured] = np.round(FULL * (1 - np.clip(share, 0, 1)))
    return _png(shades, _shades())


def diff_png(before: Raster, after: Raster) -> bytes:
    """The map as it is now, faint, and over it what became occupied, free, known and unknown, in colours.

    Raises:
        Invalid: the rectangle around both is too large for a picture.
    """
    bounds = _around(before.bounds, after.bounds)
    now = after._replace(bounds=bounds).cells().values
    changes = kinds(before._replace(bounds=bounds).cells().values, now)
    palette = (_shades() // 2 + 127).astype(np.uint8)
    palette[UNKNOWN - 1] = palette[UNKNOWN]
    picture = now // 2 * 2  # the odd indices are for the colours
    for kind, colour in _BECAME.items():
        palette[2 * kind - 1] = colour
        picture[changes == kind] = 2 * kind - 1
    return _png(picture, palette)


def _around(one: Bounds | None, other: Bounds | None) -> Bounds:
    """The rectangle around both."""
    found = [bounds for bounds in (one, other) if bounds is not None] or [(0, 0, 1, 1)]
    x0, y0 = (min(bounds[axis] for bounds in found) for axis in (0, 1))
    x1, y1 = (max(bounds[axis] for bounds in found) for axis in (2, 3))
    if (x1 - x0) * (y1 - y0) > MAX_CELLS:
        raise Invalid("the two versions are too far apart for one picture")
    return x0, y0, x1, y1


def _number(value: float) -> str:
    """Never with an exponent, which YAML readers take for a word; rounded to a micrometre."""
    return f"{value:.6f}"


def _shades() -> Palette:
    """Colours of stored occupancy."""
    grey = np.round(255 * (1 - np.arange(256) / FULL)).clip(0, 255).astype(np.uint8)
    palette = np.repeat(grey[:, None], 3, axis=1)
    palette[UNKNOWN] = (199, 209, 219)
    return palette


def _png(indices: Bytes, palette: Palette) -> bytes:
    """``indices`` (H, W) with the lowest y first; the picture has it at the bottom."""
    image = Image.fromarray(indices[::-1])
    image.putpalette(palette.tobytes())
    return _file(image, "PNG")


def _file(image: Image.Image, kind: str) -> bytes:
    file = io.BytesIO()
    image.save(file, kind)
    return file.getvalue()
