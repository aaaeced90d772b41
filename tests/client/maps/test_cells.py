"""Between arrays and tiles: cutting and joining lose nothing but digits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from tms_client import TownError
from tms_client.maps.cells import Intensity, corner_of, join, probabilities, quantised, split

shapes = st.tuples(st.integers(1, 150), st.integers(1, 150))
corners = st.tuples(st.integers(-200, 200), st.integers(-200, 200))


def drawn(seed: int, shape: tuple[int, int]) -> tuple[np.ndarray, Intensity]:
    """A map with holes, whose intensity was measured in places."""
    random = np.random.default_rng(seed)
    occupancy = np.where(random.random(shape) < 0.7, random.random(shape), np.nan)
    count = np.where(random.random(shape) < 0.3, random.integers(1, 9, shape), 0).astype(np.uint32)
    mean, variance = (np.where(count > 0, random.random(shape) * 1000, np.nan).astype(np.float32) for _ in "mv")
    return occupancy, Intensity(mean, variance, count)


@given(st.integers(0, 2**32 - 1), shapes, corners, st.booleans())
def test_what_is_cut_joins_again(
    seed: int, shape: tuple[int, int], corner: tuple[int, int], with_intensity: bool
) -> None:
    occupancy, intensity = drawn(seed, shape)
    window = join(split(corner, occupancy, intensity if with_intensity else None))
    known = ~np.isnan(occupancy) | (intensity.count > 0 if with_intensity else False)
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        assert window.occupancy.size == 0
        return
    inside = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
    assert window.corner == (corner[0] + columns[0], corner[1] + rows[0])
    np.testing.assert_allclose(window.occupancy, occupancy[inside], atol=0.5 / 254 + 1e-6)
    if with_intensity and intensity.count.any():
        assert window.intensity is not None
        for got, put in (
            (window.intensity.mean, intensity.mean),
            (window.intensity.variance, intensity.variance),
            (window.intensity.count, intensity.count),
        ):
            np.testing.assert_array_equal(got, put[inside])
    else:
        assert window.intensity is None


@given(st.integers(0, 2**32 - 1), shapes, corners)
def test_tiles_do_not_depend_on_where_the_array_ends(
    seed: int, shape: tuple[int, int], corner: tuple[int, int]
) -> None:
    """A map that grew around what is known gives the same tiles: they are not sent again."""
    occupancy, _ = drawn(seed, shape)
    grown = np.pad(occupancy, ((3, 70), (65, 1)), constant_values=np.nan)
    assert split((corner[0] - 65, corner[1] - 3), grown) == split(corner, occupancy)


@given(arrays.arrays(np.uint8, (3, 5)))
def test_stored_occupancy_is_a_fixed_point(cells: np.ndarray) -> None:
    np.testing.assert_array_equal(quantised(probabilities(cells)), cells)


@pytest.mark.parametrize("bad", [-0.01, 1.01, math.inf])
def test_what_is_no_probability_is_refused(bad: float) -> None:
    with pytest.raises(TownError, match="probability"):
        split((0, 0), np.array([[0.5, bad]]))


def test_arrays_that_are_no_map_are_refused() -> None:
    occupancy = np.full((2, 2), 0.5)
    with pytest.raises(TownError, match="height, width"):
        split((0, 0), np.zeros(3))
    ones = np.ones((2, 2), dtype=np.float32)
    count = np.ones((2, 2), dtype=np.uint32)
    for intensity in (Intensity(ones * np.nan, ones, count), Intensity(ones, -ones, count)):
        with pytest.raises(TownError, match="finite"):
            split((0, 0), occupancy, intensity)
    with pytest.raises(TownError, match="shape"):
        split((0, 0), occupancy, Intensity(ones[:1], ones, count))


def test_an_array_lies_on_the_grid_of_the_map_or_is_snapped() -> None:
    assert corner_of((-1.0, 2.5), (0.0, 0.0), 0.05) == (-20, 50)
    with pytest.raises(TownError, match=r"0\.40 cells off"):
        corner_of((0.02, 0.0), (0.0, 0.0), 0.05)
    assert corner_of((0.02, 0.07), (0.0, 0.0), 0.05, snap=True) == (0, 1)
