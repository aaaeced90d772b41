"""Our recording: what was written is read, also after a power cut and while it is being written."""

from __future__ import annotations

import contextlib
import resource
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.devices.scans import Scan, Sweep
from tms_agents.floor.recordings.formats import read_scans
from tms_agents.floor.recordings.reading import read_recording
from tms_agents.floor.recordings.recorded import in_time
from tms_agents.floor.recordings.recording import ScanWriter
from tms_agents.floor.recordings.records import Damage
from tms_client.cli import CommandError

POSE = (1.0, 2.0, 0.5)


def sweep(beams=20, reach=5.6):
    return Sweep(np.linspace(-2, 2, beams), 1e-4, 0.1, 0.02, reach, "test")


def walls(sweep, seed, *, bright=False, device=False):
    random = np.random.default_rng(seed)
    ranges = np.round(random.uniform(0.1, 5.0, len(sweep.angles)), 3)
    ranges[random.random(len(ranges)) < 0.1] = np.inf
    ranges[random.random(len(ranges)) < 0.1] = np.nan
    intensities = np.rint(random.uniform(0, 4000, len(ranges))) if bright else None
    return Scan(sweep, ranges, intensities, 7.0 + seed if device else None)


def write(path, scans, name="a", start=0):
    with contextlib.closing(ScanWriter(path)) as writer:
        for n, scan in enumerate(scans, start):
            writer.add(name, POSE, 100 + 0.1 * n, scan)


def assert_holds(found, scans):
    assert len(found) == len(scans)
    np.testing.assert_allclose(found.t, 100 + 0.1 * np.arange(len(scans)))
    np.testing.assert_allclose(found.ranges, [one.ranges for one in scans], atol=1e-9)


@pytest.mark.parametrize(("bright", "device"), [(False, False), (True, True)])
def test_what_is_written_is_read(tmp_path, bright, device):
    path, one = tmp_path / "x.scans", sweep()
    scans = [walls(one, n, bright=bright, device=device) for n in range(45)]
    write(path, scans)
    (found,) = read_scans(path)
    assert_holds(found, scans)
    assert (found.name, found.pose, found.sweep.model) == ("a", POSE, "test")
    np.testing.assert_allclose(found.sweep.angles, one.angles)
    if bright:
        np.testing.assert_array_equal(
            [found.scan(n).intensities for n in range(45)], [one.intensities for one in scans]
        )


def test_a_long_reach_and_an_endless_one(tmp_path):
    for reach, within in ((80.0, 0.0011), (np.inf, 0.0006)):
        path, one = tmp_path / f"{reach}.scans", sweep(reach=reach)
        write(path, [Scan(one, np.full(20, 63.137))])
        (found,) = read_recording(path, Damage())
        np.testing.assert_allclose(found.ranges, 63.137, atol=within)
        assert found.sweep.range_max_m == reach


def test_several_sensors_in_one_file_and_a_writer_that_goes_on(tmp_path):
    path, one, other = tmp_path / "x.scans", sweep(), sweep(30)
    writer = ScanWriter(path)
    for n in range(30):
        writer.add("a", POSE, 100 + 0.1 * n, walls(one, n))
        writer.add("b", (0.0, 0.0, 0.0), 100 + 0.1 * n, walls(other, n))
    writer.close()
    write(path, [walls(one, n) for n in range(30, 40)], start=30)  # the agent was started again
    found = read_recording(path, Damage())
    assert [(one.name, len(one)) for one in found] == [("a", 40), ("b", 30)]
    assert_holds(found[0], [walls(one, n) for n in range(40)])
    writer = ScanWriter(path)
    writer.add("a", (1.0, 2.0, 0.6), 110.0, walls(one, 40))  # it was turned
    writer.close()
    assert [(one.name, len(one), one.pose[2]) for one in read_recording(path, Damage())[::2]] == [
        ("a", 40, 0.5),
        ("a", 1, 0.6),
    ]


def test_it_is_readable_while_it_is_written(tmp_path):
    path, one = tmp_path / "x.scans", sweep()
    scans = [walls(one, n) for n in range(35)]
    writer = ScanWriter(path)
    for n, scan in enumerate(scans):
        writer.add("a", POSE, 100 + 0.1 * n, scan)
    (found,) = read_recording(path, Damage())
    assert 22 <= len(found) < 35  # all but the last second
    assert_holds(found, scans[: len(found)])
    writer.close()
    assert_holds(read_recording(path, Damage())[0], scans)


@settings(max_examples=40)
@given(cut=st.integers(0, 4000), tail=st.binary(max_size=40))
def test_a_power_cut_costs_the_last_second_and_never_the_file(tmp_path_factory, cut, tail):
    path, one = tmp_path_factory.mktemp("cut") / "x.scans", sweep()
    scans = [walls(one, n) for n in range(40)]
    write(path, scans)
    whole = path.read_bytes()
    path.write_bytes(whole[: min(cut, len(whole))] + (tail if cut > 9 else b""))
    kept = sum(map(len, read_recording(path, Damage())))
    write(path, [walls(one, n) for n in range(40, 50)], start=40)
    found = read_recording(path, Damage())
    assert sum(map(len, found)) == kept + 10
    np.testing.assert_allclose(np.concatenate([one.t for one in found])[:kept], 100 + 0.1 * np.arange(kept))


def test_it_is_compact(tmp_path):
    """Noise of 4 mm on walls at rest: less than a byte and a half per range."""
    path, one = tmp_path / "x.scans", sweep(681)
    random = np.random.default_rng(2)
    write(path, [Scan(one, np.round(2 + random.normal(0, 0.004, 681), 3)) for _ in range(200)])
    assert path.stat().st_size < 1.0 * 200 * 681


def test_a_long_recording_takes_little_memory(tmp_path):
    """It is gone through scan by scan; what is in memory is a block, and a time per scan."""
    path, one = tmp_path / "x.scans", sweep(700)
    random = np.random.default_rng(3)
    scans = [Scan(one, np.round(2 + random.normal(0, 0.004, 700), 3)) for _ in range(50)]
    write(path, [scans[n % 50] for n in range(2000)])
    tracemalloc.start()
    recordings = read_scans(path)
    total = sum(float(recordings[number].scan(n).ranges[0]) for number, n in in_time(recordings))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert total == pytest.approx(sum(40 * scan.ranges[0] for scan in scans))
    assert peak < 1_500_000, "all ranges at once would be 11 MB"


def test_the_file_that_was_opened_is_read_also_when_another_has_its_name(tmp_path):
    """As a recording that is full gets another name while somebody plays it."""
    path, one = tmp_path / "x.scans", sweep()
    scans = [walls(one, n) for n in range(30)]
    write(path, scans)
    (found,) = read_scans(path)
    path.rename(path.with_name("x.scans.old"))
    write(path, [walls(one, 99)])
    assert_holds(found, scans)
    with path.with_name("x.scans.old").open("r+b") as file:
        file.truncate(100)
    with pytest.raises(CommandError, match=r"x\.scans: it changed while it was read"):
        [found.scan(n) for n in range(30)]


def test_every_scan_has_the_intensities_that_it_came_with(tmp_path):
    path, one = tmp_path / "x.scans", sweep()
    scans = [walls(one, n, bright=n < 7 or 13 <= n < 16 or n > 30) for n in range(45)]
    write(path, scans)
    (found,) = read_scans(path)
    assert_holds(found, scans)
    for n, scan in enumerate(scans):
        if scan.intensities is None:
            assert found.scan(n).intensities is None
        else:
            np.testing.assert_array_equal(found.scan(n).intensities, scan.intensities)


def test_a_full_disk_leaves_whole_records(tmp_path):
    path, one = tmp_path / "x.scans", sweep(200)
    scans = [walls(one, n) for n in range(400)]
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            write(path, scans)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    damage = Damage()
    (found,) = read_recording(path, damage)
    assert_holds(found, scans[: len(found)])
    assert len(found) > 20 and not damage.in_words()


def test_nothing_recorded_is_no_file(tmp_path):
    ScanWriter(tmp_path / "x.scans").close()
    assert not (tmp_path / "x.scans").exists()
