"""Bytes of tiles: what goes in comes out, and nothing else is a tile."""

from __future__ import annotations

import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_schemas.tiles import CELLS, MAX_PACKED, MAX_TEXT, Planes, TileError, from_text, pack, to_text, unpack


def stretched(seed: bytes, size: int) -> bytes:
    return (seed * (size // len(seed) + 1))[:size]


@st.composite
def planes(draw: st.DrawFn) -> Planes:
    seed = draw(st.binary(min_size=1, max_size=200))
    with_intensity = draw(st.booleans())
    return Planes(stretched(seed, CELLS), stretched(seed[::-1], 12 * CELLS) if with_intensity else b"")


@given(planes())
def test_a_tile_comes_back(tile: Planes) -> None:
    data = pack(tile)
    assert unpack(data) == tile and len(data) <= MAX_PACKED
    text = to_text(data)
    assert from_text(text) == data and len(text) <= MAX_TEXT
    assert unpack(data).digest == tile.digest


@given(planes(), planes())
def test_the_digest_is_of_the_content(one: Planes, other: Planes) -> None:
    assert (one.digest == other.digest) == (one == other)
    repacked = bytes([pack(one)[0]]) + zlib.compress(one.occupancy + one.intensity, 1)
    assert unpack(repacked).digest == one.digest


def test_the_largest_tile_fits() -> None:
    import random

    noise = random.Random(1).randbytes(13 * CELLS)
    assert len(pack(Planes(noise[:CELLS], noise[CELLS:]))) <= MAX_PACKED


def only_tiles(data: bytes) -> None:
    """Either these are the bytes of a tile, or the parser says why not."""
    try:
        found = unpack(data)
    except TileError as error:
        assert str(error)
    else:
        assert len(found.occupancy) == CELLS and len(found.intensity) in (0, 12 * CELLS)
        assert unpack(pack(found)) == found


@given(st.binary(max_size=300) | st.binary(max_size=300).map(lambda data: b"\1" + data))
def test_any_bytes_are_a_tile_or_an_error(data: bytes) -> None:
    only_tiles(data)


@given(planes(), st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=4), st.data())
def test_damaged_tiles_are_a_tile_or_an_error(
    tile: Planes, changes: list[tuple[int, int]], data: st.DataObject
) -> None:
    damaged = bytearray(pack(tile))
    for place, value in changes:
        damaged[place % len(damaged)] = value
    only_tiles(bytes(damaged))
    only_tiles(bytes(damaged[: data.draw(st.integers(0, len(damaged)))]))


@pytest.mark.parametrize("size", [CELLS + 1, 10**8])
def test_a_bomb_is_not_inflated(size: int) -> None:
    """However much a stream promises, no more than a tile is made of it."""
    import tracemalloc

    compressor = zlib.compressobj(9)
    bomb = b"\1" + b"".join(compressor.compress(bytes(min(10**6, size - at))) for at in range(0, size, 10**6))
    bomb += compressor.flush()
    tracemalloc.start()
    with pytest.raises(TileError, match="more than"):
        unpack(bomb)
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()


@given(st.text(max_size=50))
def test_any_text_is_base64_or_an_error(text: str) -> None:
    try:
        data = from_text(text)
    except TileError:
        return
    assert to_text(data) == text


@pytest.mark.parametrize("tile", [Planes(b""), Planes(bytes(CELLS), bytes(5)), Planes(bytes(CELLS + 1))])
def test_planes_of_another_size_are_refused(tile: Planes) -> None:
    with pytest.raises(TileError):
        pack(tile)
