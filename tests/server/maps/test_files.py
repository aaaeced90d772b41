"""Pictures and ROS files: read by readers that know nothing of the writer."""

from __future__ import annotations

import io
from datetime import UTC, datetime

import httpx
import map_server
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from map_robot import MAP, Robot, measured, tile
from PIL import Image

from tms_schemas.maps import TownMap
from tms_schemas.tiles import SIDE, UNKNOWN, Planes, pack
from tms_server.maps import pictures
from tms_server.maps.cells import Raster

NOW = datetime(2026, 11, 1, tzinfo=UTC)


def town_map(resolution: float, origin: tuple[float, float]) -> TownMap:
    fields = {"id": "m", "room": "lab", "version": 1, "created_at": NOW, "updated_at": NOW}
    return TownMap(**fields, resolution=resolution, origin=origin)


@st.composite
def rasters(draw: st.DrawFn) -> tuple[Raster, np.ndarray]:
    """Tiles with their bounds; and the same cells as one array, from which to judge."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    x0, y0 = draw(st.tuples(st.integers(-3, 3), st.integers(-3, 3)))
    cells = random.integers(0, 255, (2 * SIDE, 2 * SIDE)).astype(np.uint8)
    cells[random.random(cells.shape) < 0.4] = UNKNOWN
    left, bottom = draw(st.tuples(st.integers(0, 127), st.integers(0, 127)))
    right, top = draw(st.tuples(st.integers(left + 1, 128), st.integers(bottom + 1, 128)))
    inside = np.zeros(cells.shape, dtype=bool)
    inside[bottom:top, left:right] = True
    cells[~inside] = UNKNOWN
    tiles = [
        (x0 + i, y0 + j, pack(Planes(cells[j * SIDE :, i * SIDE :][:SIDE, :SIDE].tobytes())))
        for i in (0, 1)
        for j in (0, 1)
    ]
    bounds = (x0 * SIDE + left, y0 * SIDE + bottom, x0 * SIDE + right, y0 * SIDE + top)
    return Raster(bounds, tiles), cells[bottom:top, left:right]


@given(rasters(), st.sampled_from([0.02, 0.05, 1 / 3, 1.0]), st.tuples(*[st.floats(-1e4, 1e4)] * 2))
def test_ros_reads_what_was_written(
    drawn: tuple[Raster, np.ndarray], resolution: float, origin: tuple[float, float]
) -> None:
    raster, cells = drawn
    p = np.where(cells == UNKNOWN, np.nan, cells / 254)
    about = town_map(resolution, origin)
    found = map_server.load(pictures.yaml(about, 1, raster.bounds, "trinary"), pictures.pgm(raster.cells(), "trinary"))
    np.testing.assert_array_equal(found.data, np.select([p > 0.65, p < 0.196], [100, 0], -1))
    raw = map_server.load(pictures.yaml(about, 1, raster.bounds, "raw"), pictures.pgm(raster.cells(), "raw"))
    np.testing.assert_array_equal(raw.data, np.where(np.isnan(p), -1, np.round(100 * np.nan_to_num(p))))
    x0, y0 = raster.bounds[:2]  # type: ignore[index]
    for grid in (found, raw):
        assert grid.resolution == resolution
        want = (origin[0] + x0 * resolution, origin[1] + y0 * resolution, 0.0)
        assert grid.origin == pytest.approx(want, abs=1e-6)


@pytest.fixture
async def drawn(robot: Robot) -> Robot:
    """A wall, a free cell, an unsure one, and one of which only the intensity is known."""
    one = tile((2, 3, 254), (3, 3, 0), (4, 3, 127))
    assert (await robot.send(0, {(0, 0): one, (-1, 0): measured((63, 5), 40.0, 4.0, 9)})).status_code == 201
    return robot


async def get(http: httpx.AsyncClient, path: str, kind: str, **params: object) -> bytes:
    answer = await http.get(f"/v1/maps/{path}", params=params)  # type: ignore[arg-type]
    assert answer.status_code == 200 and answer.headers["content-type"].startswith(kind), answer.text
    return answer.content


async def test_a_map_for_ros(http: httpx.AsyncClient, drawn: Robot) -> None:
    for mode, wall, free, unsure in (("trinary", 100, 0, -1), ("raw", 100, 0, 50)):
        description = (await get(http, "corridor.yaml", "application/yaml", mode=mode)).decode()
        assert "image: corridor.pgm\n" in description
        grid = map_server.load(description, await get(http, "corridor.pgm", "image/x-portable-graymap", mode=mode))
        assert grid.data.shape == (3, 6)
        x, y = MAP["origin"]
        step = MAP["resolution"]
        at = [grid.at(x + (column + 0.5) * step, y + (row + 0.5) * step) for column, row in ((2, 3), (3, 3), (4, 3))]
        assert at == [wall, free, unsure]
        assert grid.at(x - 0.5 * step, y + 5.5 * step) == -1


async def test_pictures(http: httpx.AsyncClient, drawn: Robot) -> None:
    picture = np.asarray(Image.open(io.BytesIO(await get(http, "corridor.png", "image/png"))).convert("RGB"))
    assert picture.shape == (3, 6, 3)
    assert picture[2, 3:].tolist() == [[0, 0, 0], [255, 255, 255], [128, 128, 128]]  # the lowest row is the last
    for layer in ("mean", "variance", "count"):
        data = await get(http, "corridor.png", "image/png", layer=layer)
        shown = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
        grey = (shown[..., 0] == shown[..., 1]) & (shown[..., 1] == shown[..., 2])
        assert np.argwhere(grey).tolist() == [[0, 0]]
    for path in (
        "corridor.png?layer=colour",
        "corridor.pgm?mode=scale",
        "corridor.yaml?mode=1",
        "corridor.png?version=x",
    ):
        assert (await http.get(f"/v1/maps/{path}")).status_code == 422
    for suffix in (".png", ".pgm", ".yaml"):
        assert (await http.get(f"/v1/maps/corridor{suffix}?version=7")).status_code == 404
        assert (await http.get(f"/v1/maps/nowhere{suffix}")).status_code == 404


async def test_what_changed(http: httpx.AsyncClient, drawn: Robot) -> None:
    moved = tile((2, 3, 0), (3, 3, 254), (4, 3, 130), (9, 9, 0), fill=UNKNOWN)
    await drawn.send(1, {(0, 0): moved, (7, 7): tile(fill=200)}, removed=[{"x": -1, "y": 0}])
    diff = (await http.get("/v1/maps/corridor/diff", params={"before": 1})).json()
    assert diff["tiles"] == [{"x": -1, "y": 0}, {"x": 0, "y": 0}, {"x": 7, "y": 7}]
    counts = [diff[f"became_{kind}"] for kind in ("occupied", "free", "known", "unknown")]
    assert counts == [1, 1, 1 + SIDE * SIDE, 0]
    back = (await http.get("/v1/maps/corridor/diff", params={"before": 2, "after": 1})).json()
    assert [back[f"became_{kind}"] for kind in ("occupied", "free", "known", "unknown")] == [1, 1, 0, 1 + SIDE * SIDE]
    same = (await http.get("/v1/maps/corridor/diff", params={"before": 2, "after": 2})).json()
    assert same["tiles"] == [] and same["became_known"] == 0
    first = (await http.get("/v1/maps/corridor/diff", params={"before": 0, "after": 1})).json()
    assert first["became_known"] == 3
    data = await get(http, "corridor/diff.png", "image/png", before=1)
    picture = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
    upright = picture[::-1]
    red, blue = upright[0, 4].tolist(), upright[0, 3].tolist()  # bounds begin at column -1, row 3
    assert red[0] > 200 > red[2] and blue[2] > 150 > blue[0]
    yellow = upright[6, 10].tolist()
    assert yellow[0] > 200 and yellow[1] > 200 > yellow[2]
    assert (await http.get("/v1/maps/corridor/diff")).status_code == 422
    assert (await http.get("/v1/maps/corridor/diff", params={"before": 9})).status_code == 404


async def test_versions_too_far_apart_have_no_common_picture(http: httpx.AsyncClient, robot: Robot) -> None:
    far = 2**19
    await robot.send(0, {(-far, -far): tile(fill=1)})
    await robot.send(1, {(far, far): tile(fill=1)}, removed=[{"x": -far, "y": -far}])
    answer = await http.get("/v1/maps/corridor/diff.png", params={"before": 1})
    assert answer.status_code == 422 and "too far apart" in answer.json()["detail"]
    assert (await http.get("/v1/maps/corridor/diff", params={"before": 1})).json()["became_known"] == SIDE * SIDE


def test_an_empty_map_has_a_picture() -> None:
    empty = Raster(None, [])
    grid = map_server.load(pictures.yaml(town_map(0.05, (1, 2)), 0, None, "raw"), pictures.pgm(empty.cells(), "raw"))
    assert grid.data.tolist() == [[-1]] and grid.origin == (1.0, 2.0, 0.0)
    for picture in (pictures.occupancy_png(empty.cells()), pictures.intensity_png(empty.cells("mean"))):
        assert Image.open(io.BytesIO(picture)).size == (1, 1)
