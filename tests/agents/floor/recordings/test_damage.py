"""A damaged recording: what is whole is read, what is not is said, and no writer takes anything away."""

from __future__ import annotations

import struct
import time
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.devices.scans import Scan, Sweep
from tms_agents.floor.recordings.formats import read_scans
from tms_agents.floor.recordings.reading import read_recording
from tms_agents.floor.recordings.recording import ScanWriter
from tms_agents.floor.recordings.records import MAGIC, Damage
from tms_client.cli import CommandError

HEAD = struct.Struct("<cII")


def sweep(beams=12):
    return Sweep(np.linspace(-2, 2, beams), 1e-4, 0.1, 0.02, 5.6)


def write(path, times, names=("a", "b"), one=None):
    """A scan of each laser at each time; every laser has its own ranges."""
    writer, one = ScanWriter(path), one or sweep()
    for t in times:
        for n, name in enumerate(names):
            writer.add(name, (float(n), 0.0, 0.0), t + 0.01 * n, Scan(one, np.full(len(one.angles), 1.0 + n)))
    writer.close()
    return writer


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Two lasers, described three times each, as bytes."""
    path = tmp_path_factory.mktemp("whole") / "x.scans"
    for start in (0.0, 10.0, 20.0):
        write(path, start + np.arange(0.0, 4.0, 0.1))
    return path.read_bytes()


def spans(data):
    """(start, end, kind, sensor, times) of all records of an intact file."""
    at = len(MAGIC)
    while at < len(data):
        kind, length, _ = HEAD.unpack_from(data, at)
        body = data[at + HEAD.size : at + HEAD.size + length]
        if kind == b"S":
            yield (
                at,
                at + HEAD.size + length,
                kind,
                int(zlib.decompress(body).split(b'"sensor": ')[1].split(b",")[0]),
                [],
            )
        else:
            sensor, scans = struct.unpack_from("<HH", body)
            times = np.frombuffer(zlib.decompress(body[9:]), np.float64, scans)
            yield at, at + HEAD.size + length, kind, sensor, list(times)
        at += HEAD.size + length


def expected(data, first, last):
    """The times of all scans whose block and description have no byte within [first, last)."""
    whole = [one for one in spans(data) if not (first < one[1] and last > one[0])]
    described = {sensor for _, _, kind, sensor, _ in whole if kind == b"S"}
    return sorted(t for _, _, kind, sensor, times in whole if kind == b"B" and sensor in described for t in times)


def times_of(recordings):
    """All times; the ranges are those of the laser that made them."""
    for one in recordings:
        np.testing.assert_array_equal(one.ranges, 1.0 if one.name == "a" else 2.0)
    return sorted(float(t) for one in recordings for t in one.t)


@settings(max_examples=150, deadline=None)
@given(
    at=st.floats(0, 1),
    width=st.integers(1, 60),
    kind=st.sampled_from(["flip", "cut", "put", "noise"]),
    bits=st.integers(1, 255),
)
def test_whatever_is_damaged_the_rest_is_read_and_stays(tmp_path_factory, whole, at, width, kind, bits):
    path = tmp_path_factory.mktemp("damaged") / "x.scans"
    first = min(int(at * len(whole)), len(whole) - 1)
    width = 1 if kind == "flip" else min(width, len(whole) - first)
    middle = {
        "flip": bytes([whole[first] ^ bits]),
        "cut": b"",
        "put": bytes([bits]) * width + whole[first : first + width],
        "noise": bytes((byte ^ bits) for byte in whole[first : first + width]),
    }[kind]
    path.write_bytes(whole[:first] + middle + whole[first + width :])
    wanted = expected(whole, first, first + width)
    damage = Damage()
    assert set(wanted) <= set(times_of(read_recording(path, damage))) <= set(expected(whole, 0, 0))
    lost = len(expected(whole, 0, 0)) - len(times_of(read_recording(path, Damage())))
    assert bool(damage.in_words()) == (damage.skipped + damage.tail > 0) and (not lost or damage.in_words())
    write(path, np.arange(30.0, 32.0, 0.1))
    after = times_of(read_recording(path, Damage()))
    assert set(wanted) <= set(after) and sum(t >= 30.0 for t in after) == 40
    assert len(after) == len(set(after))


@settings(max_examples=40, deadline=None)
@given(kept=st.floats(0, 1), tail=st.binary(max_size=60))
def test_only_a_torn_end_is_cut_off(tmp_path_factory, whole, kept, tail):
    path = tmp_path_factory.mktemp("torn") / "x.scans"
    end = len(MAGIC) + int(kept * (len(whole) - len(MAGIC)))
    path.write_bytes(whole[:end] + tail)
    ends = [len(MAGIC), *(one[1] for one in spans(whole))]
    ScanWriter(path).close()
    left = path.read_bytes()
    assert left == whole[: len(left)] and len(left) == max(one for one in ends if one <= max(end, len(left)))


def test_it_is_said_what_was_skipped(tmp_path, whole):
    path, said = tmp_path / "x.scans", []
    blocks = [one for one in spans(whole) if one[2] == b"B"]
    start, end, _, _, times = blocks[len(blocks) // 3]
    damaged = bytearray(whole)
    damaged[(start + end) // 2] ^= 1
    path.write_bytes(damaged)
    found = read_scans(path, said.append)
    assert sum(map(len, found)) == 240 - len(times)
    assert said == [f"{path}: {end - start} bytes are damaged and were skipped"]
    write(path, [40.0])
    assert path.read_bytes()[: len(damaged)] == damaged, "the writer takes nothing away"
    assert sum(map(len, read_scans(path, said.append))) == 242 - len(times)


def test_a_laser_whose_description_is_damaged_is_lost_until_it_is_described_again(tmp_path, whole):
    path, said = tmp_path / "x.scans", []
    (start, end, *_) = next(one for one in spans(whole) if one[2] == b"S")
    damaged = bytearray(whole)
    damaged[start + 20] ^= 1
    path.write_bytes(damaged)
    found = {one.name: len(one) for one in read_scans(path, said.append)}
    assert found == {"a": 80, "b": 120}
    assert said == [
        f"{path}: {end - start} bytes are damaged and were skipped; "
        "40 scans are lost because what describes their laser is damaged"
    ]
    write(path, [40.0], names=("b",))  # no number of before is given again
    assert sorted(len(one) for one in read_scans(path, said.append)) == [1, 80, 120]


def test_a_laser_is_described_again_so_that_one_damaged_description_costs_nothing(tmp_path):
    path, said = tmp_path / "x.scans", []
    write(path, np.arange(0.0, 700.0, 0.5), names=("b",))
    data = bytearray(path.read_bytes())
    descriptions = [start for start, _, kind, *_ in spans(data) if kind == b"S"]
    assert len(descriptions) == 2
    for at in descriptions:
        damaged = bytearray(data)
        damaged[at + 20] ^= 1
        path.write_bytes(damaged)
        (one,) = read_scans(path, said.append)
        assert np.array_equal(one.t, np.arange(0.0, 700.0, 0.5))
        assert "lost" not in said[-1]


def test_a_large_end_that_cannot_be_read_is_kept(tmp_path, whole):
    path = tmp_path / "x.scans"
    path.write_bytes(whole + bytes(5_000_000))
    write(path, [40.0])
    assert path.read_bytes().startswith(whole + bytes(5_000_000))
    assert sum(map(len, read_scans(path))) == 242


def test_much_damage_is_passed_quickly(tmp_path, whole):
    """Looking for the next record takes time in proportion to what is damaged, also where much looks like a record."""
    path = tmp_path / "x.scans"
    random = np.random.default_rng(4).integers(0, 256, 8_000_000, np.uint8).tobytes()
    heads = (b"B" + struct.pack("<II", 60_000_000, 1) + struct.pack("<HHIB", 0, 9, 9, 0) + b"x\x9c") * 200_000
    path.write_bytes(whole[: len(whole) // 2] + random + heads + whole[len(whole) // 2 :])
    begun = time.perf_counter()
    assert sum(map(len, read_scans(path))) >= 180
    assert time.perf_counter() - begun < 10.0


def test_what_holds_no_record_at_all_is_no_recording(tmp_path):
    path = tmp_path / "x.scans"
    path.write_bytes(b"TMSSCAN2\n" + bytes(1000))
    with pytest.raises(CommandError, match="it is no recording of scans"):
        read_scans(path)
    with pytest.raises(ValueError, match="it is no recording of scans"):
        ScanWriter(path)
    assert len(path.read_bytes()) == 1009
