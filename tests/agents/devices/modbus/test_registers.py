"""Registers to weights and back: laws, published maps, and registers that mean no weight."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.devices.modbus import StatusRegister, WeighingMap, laumas_tlu, pavone_dat_400, pt113

MAPS = st.builds(
    WeighingMap,
    cells=st.lists(st.integers(0, 1000).map(lambda n: 2 * n), min_size=1, max_size=6, unique=True),
    kind=st.sampled_from(["int32", "uint32", "float32"]),
    low_word_first=st.booleans(),
    scale=st.sampled_from([1.0, 0.1, 1000.0]),
)


@given(MAPS, st.data())
def test_what_is_encoded_is_decoded(registers, data):
    numbers = [data.draw(st.integers(0, 1 << 24)) for _ in registers.cells]
    values = [number * registers.scale for number in numbers]
    assert registers.decode(registers.encode(values)).values == pytest.approx(values)


@given(MAPS)
def test_questions_cover_every_register_once_and_are_short(registers):
    asked = [address + i for address, count in registers.blocks() for i in range(count)]
    assert sorted(asked) == sorted(address + word for address in registers.cells for word in (0, 1))
    assert all(count <= 32 for _, count in registers.blocks())


@given(
    st.sampled_from(["int16", "uint16", "int32", "uint32", "float32"]),
    st.booleans(),
    st.lists(st.integers(0, 0xFFFF), min_size=3, max_size=3),
)
def test_any_registers_are_a_finite_weight_or_say_why(kind, low_word_first, words):
    registers = WeighingMap(
        cells=(0,), kind=kind, low_word_first=low_word_first, status=StatusRegister(address=2, valid=1)
    )
    sample = registers.decode(dict(enumerate(words)))
    assert math.isfinite(sample.values[0]) if not sample.fault else math.isnan(sample.values[0])


@pytest.mark.parametrize(
    ("kind", "low_word_first", "words", "value"),
    [
        ("int32", False, (0x0001, 0x86A0), 100_000.0),
        ("int32", True, (0x86A0, 0x0001), 100_000.0),
        ("int32", False, (0xFFFF, 0xFFFE), -2.0),
        ("uint32", False, (0xFFFF, 0xFFFE), 4_294_967_294.0),
        ("int16", False, (0xFFFE,), -2.0),
        ("uint16", False, (0xFFFE,), 65_534.0),
        ("float32", False, (0x4148, 0x0000), 12.5),
    ],
)
def test_word_order_and_sign(kind, low_word_first, words, value):
    registers = WeighingMap(cells=(0,), kind=kind, low_word_first=low_word_first)
    assert registers.decode(dict(enumerate(words))).values == (value,)


def test_published_maps():
    dat = pavone_dat_400(0.1)
    assert dat.blocks() == [(0, 3)]
    stable = dat.decode({0: 0b10, 1: 0, 2: 1234})
    assert (stable.values, stable.stable, stable.fault) == ((pytest.approx(123.4),), True, "")
    assert dat.decode({0: 1 << 5, 1: 0, 2: 1234}).fault == "overload"
    pt = pt113(1.0)
    assert pt.decode({0: 0, 1: 7, 2: 0b010}).stable is True
    assert pt.decode({0: 0, 1: 7, 2: 0b110}).stable is False
    assert pt.decode({0: 0, 1: 7, 2: 0b000}).fault == "the module calls its data invalid"
    assert laumas_tlu(1.0).blocks() == [(7, 2)]


def test_impossible_maps_are_refused():
    with pytest.raises(ValueError, match="at least one cell"):
        WeighingMap(cells=())
    with pytest.raises(ValueError, match="0 to 65534"):
        WeighingMap(cells=(70_000,))
    with pytest.raises(ValueError, match="device id 248"):
        WeighingMap(cells=(1,), device_id=248)
    with pytest.raises(ValueError, match="scale of 0"):
        WeighingMap(cells=(1,), scale=0.0)
