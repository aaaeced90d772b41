"""Light holds a scan along a wall where geometry lets it slip, and lets it alone where there are no colours."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.slam.gridmap import render
from tms_agents.slam.light.closures import placed_by_light
from tms_agents.slam.light.filtering import as_beams
from tms_agents.slam.light.layer import LightMaps, light_at
from tms_agents.slam.light.matching import match_light
from tms_agents.slam.light.scans import LightScan

ALONG = np.linspace(-3.0, 3.0, 401)
#: Of the colours, at places a few decimetres long.
COLOURS = np.random.default_rng(5).uniform(-1.0, 0.6, 25)


def wall(*, coloured: bool, seed: int = 0) -> LightScan:
    """Two long walls, 2 m apart."""
    random = np.random.default_rng(seed)
    points = np.concatenate([np.stack([ALONG, np.full(401, y)], axis=-1) for y in (-1.0, 1.0)])
    light = np.interp(np.tile(ALONG, 2), np.linspace(-3, 3, 25), COLOURS) if coloured else np.zeros(802)
    tangents = np.tile([1.0, 0.0], (802, 1))
    return LightScan(points, tangents, light + random.normal(0, 0.05, 802), np.full(802, 0.05))


def world(coloured: bool):
    scan = wall(coloured=coloured)
    maps = render(np.zeros((1, 3)), [scan.points], np.zeros(2), 0.05, 0.5)
    light = LightMaps(1, 0.05)
    light.integrate(np.zeros((1, 3)), scan)
    return maps, light


def matched(coloured: bool, start: np.ndarray) -> np.ndarray:
    maps, light = world(coloured)
    middle = wall(coloured=coloured, seed=1).thinned(300)
    pose, hessian, result = start.copy(), np.empty((3, 3)), np.empty(3)
    cloud = middle.points[np.abs(middle.points[:, 0]) < 2.0]  # the ends of the walls are not seen
    tiles = light.tiles
    match_light(
        maps.distance.directory[0], maps.distance.cells, maps.metres, maps.frame, cloud,
        tiles.directory[0], tiles.cells, light.frame, as_beams(middle), start, np.diag([600.0, 600.0, 600.0]), 0.1,
        1.0, 1.5, pose, hessian, result,
    )  # fmt: skip
    return pose


@pytest.mark.parametrize("start", [(0.08, 0.03, 0.01), (-0.07, -0.02, 0.0)])
def test_along_a_coloured_wall(start):
    pose = matched(True, np.array(start))
    np.testing.assert_allclose(pose[[0, 2]], 0.0, atol=0.015)
    assert abs(pose[1]) < 0.04  # the walls lie on the border of two cells


def test_along_a_wall_of_one_colour_odometry_decides():
    pose = matched(False, np.array([0.08, 0.03, 0.0]))
    assert pose[0] == pytest.approx(0.08, abs=0.02)
    assert abs(pose[1]) < 0.04


def test_the_layer_holds_what_was_seen_and_its_slope():
    maps = LightMaps(1, 0.05)
    scan = wall(coloured=False)
    ramp = LightScan(scan.points, scan.tangents, 0.5 * scan.points[:, 0], scan.deviation)
    maps.integrate(np.zeros((1, 3)), ramp)
    found = np.empty(3)
    place = (np.array([0.7, 1.0]) - maps.frame[:2]) * maps.frame[2]
    known = light_at(maps.tiles.directory[0], maps.tiles.cells, *place, found)
    assert known > 100.0
    assert found[0] == pytest.approx(0.35, abs=0.03)
    assert found[1] * maps.frame[2] == pytest.approx(0.5, abs=0.2)
    nowhere = (np.array([0.7, 0.0]) - maps.frame[:2]) * maps.frame[2]
    assert light_at(maps.tiles.directory[0], maps.tiles.cells, *nowhere, found) == 0.0


def test_maps_share_until_one_is_written():
    maps = LightMaps(2, 0.05)
    maps.integrate(np.zeros((2, 3)), wall(coloured=True))
    maps.resample(np.zeros(2, dtype=np.int32))
    np.testing.assert_array_equal(maps.tiles.directory[0], maps.tiles.directory[1])
    before = maps.tiles.tiles_used
    maps.integrate(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]), wall(coloured=True))
    assert maps.tiles.tiles_used > before


def revisit(off: float, lights: LightScan) -> np.ndarray | None:
    """Where a cloud that geometry put ``off`` m along the corridor is found."""
    maps, light = world(True)
    inner = np.abs(lights.points[:, 0]) < 1.8
    cloud = lights.points[inner][::4]
    beams = LightScan(*(getattr(lights, name)[inner] for name in ("points", "tangents", "light", "deviation")))
    hessian = np.diag([1.0, 5000.0, 5000.0])
    placed = placed_by_light(
        maps, 0, light, np.ascontiguousarray(cloud), beams, np.array([off, 0.0, 0.0]), hessian, 1.0, 1.5
    )
    return None if placed is None else placed[0]


@pytest.mark.parametrize("off", [0.6, -0.9])
def test_a_revisit_is_moved_along_to_where_its_colours_are(off):
    found = revisit(off, wall(coloured=True, seed=2))
    assert found is not None
    np.testing.assert_allclose(found, 0.0, atol=0.03)


def test_a_revisit_with_other_colours_is_none():
    scan = wall(coloured=True, seed=3)
    other = np.interp(np.tile(ALONG, 2), np.linspace(-3, 3, 25), np.random.default_rng(9).uniform(-1.0, 0.6, 25))
    assert revisit(0.3, LightScan(scan.points, scan.tangents, other, scan.deviation)) is None
