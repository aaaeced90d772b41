"""Maps that share tiles behave like maps of their own."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.slam.tiles import SIDE, TiledMaps

BLANK, MAPS, HEIGHT, WIDTH = 7, 4, 2, 3

writes = st.tuples(
    st.just("write"),
    st.integers(0, MAPS - 1),
    st.integers(0, HEIGHT * SIDE - 1),
    st.integers(0, WIDTH * SIDE - 1),
    st.integers(0, 255),
)
resamplings = st.tuples(st.just("resample"), st.lists(st.integers(0, MAPS - 1), min_size=MAPS, max_size=MAPS))


def write(maps: TiledMaps, n: int, y: int, x: int, value: int) -> None:
    wanted = np.zeros((MAPS, 1), dtype=np.int32)
    counts = np.zeros(MAPS, dtype=np.int32)
    width = maps.directory.shape[2]
    wanted[n, 0], counts[n] = (y // SIDE) * width + x // SIDE, 1
    maps.make_writable(wanted, counts)
    maps.cells[maps.directory[n, y // SIDE, x // SIDE], (y % SIDE) * SIDE + x % SIDE] = value


@settings(max_examples=60)
@given(st.lists(st.one_of(writes, writes, resamplings), max_size=40))
def test_copy_on_write_is_as_good_as_a_copy(operations):
    maps = TiledMaps(MAPS, BLANK, HEIGHT, WIDTH)
    copies = np.full((MAPS, HEIGHT * SIDE, WIDTH * SIDE), BLANK, dtype=np.uint8)
    for kind, *what in operations:
        if kind == "write":
            n, y, x, value = what
            write(maps, n, y, x, value)
            copies[n, y, x] = value
        else:
            parents = np.array(what[0], dtype=np.int32)
            maps.resample(parents)
            copies = copies[parents]
    for n in range(MAPS):
        np.testing.assert_array_equal(maps.dense(n), copies[n])
    used = np.unique(maps.directory)
    assert maps.tiles_used == len(used[used > 0])


def test_resampling_copies_no_cell_and_writing_copies_one_tile():
    maps = TiledMaps(MAPS, BLANK, HEIGHT, WIDTH)
    for x in range(0, WIDTH * SIDE, SIDE):
        write(maps, 2, 0, x, 1)
    maps.resample(np.full(MAPS, 2, dtype=np.int32))
    assert maps.tiles_used == WIDTH
    write(maps, 0, 0, 0, 9)
    assert maps.tiles_used == WIDTH + 1
    assert [int(maps.dense(n)[0, 0]) for n in range(MAPS)] == [9, 1, 1, 1]


def test_more_tiles_than_there_were_at_first():
    maps = TiledMaps(MAPS, BLANK, 30, 30)
    wanted = np.tile(np.arange(900, dtype=np.int32), (MAPS, 1))
    maps.make_writable(wanted, np.full(MAPS, 900, dtype=np.int32))
    assert maps.tiles_used == MAPS * 900
    assert len(np.unique(maps.directory)) == MAPS * 900
    maps.clear()
    assert maps.tiles_used == 0


def test_the_rectangle_grows_on_every_side():
    maps = TiledMaps(MAPS, BLANK, HEIGHT, WIDTH)
    write(maps, 1, 5, 6, 3)
    maps.extend(1, 2, 3, 4)
    dense = maps.dense(1)
    assert dense.shape == ((HEIGHT + 4) * SIDE, (WIDTH + 6) * SIDE)
    assert dense[5 + SIDE, 6 + 2 * SIDE] == 3
