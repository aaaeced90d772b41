"""The simulated laser: beams meet what geometry says, and err as recordings of real ones were measured to err."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.simulation.floor_world.lasers import COARSE, FAINT, FINE, Laser, NoiseParameters, misplaced
from tms_agents.simulation.floor_world.noise import LaserErrors
from tms_agents.simulation.floor_world.raycaster import Cast, cast
from tms_agents.simulation.floor_world.shapes import BLACK, MIRROR, NOBODY, Drawing, Material

HALF = math.radians(135)


def swept(drawing: Drawing, pose: Any = (0.0, 0.0, 0.0), increment_s: float = 0.0) -> Cast:
    return cast(drawing.shapes(), pose, -HALF, math.radians(0.25), 1081, increment_s)


# geometry


@given(st.floats(-math.pi, math.pi), st.floats(-3, 3), st.floats(-3, 3), st.floats(0.5, 4))
@settings(max_examples=50)
def test_in_a_round_room_every_beam_ends_on_the_wall(theta: float, x: float, y: float, radius: float) -> None:
    far = radius + math.hypot(x, y) + 0.1
    drawing = Drawing()
    corners = [(far * math.cos(a), far * math.sin(a)) for a in np.linspace(0, 2 * math.pi, 400, endpoint=False)]
    drawing.polygon(corners, owner=7)
    seen = swept(drawing, (x, y, theta))
    angles = theta - HALF + np.arange(1081) * math.radians(0.25)
    ends = np.hypot(x + seen.ranges * np.cos(angles), y + seen.ranges * np.sin(angles))
    assert np.all(np.abs(ends - far) < 0.001 * far)
    assert np.all(seen.owners == 7)


@given(st.floats(0.2, 6), st.floats(-2.2, 2.2), st.floats(0.01, 0.15))
@settings(max_examples=100)
def test_a_leg_is_met_by_the_beams_within_its_width_and_nothing_else(r: float, bearing: float, radius: float) -> None:
    drawing = Drawing()
    drawing.circle((r * math.cos(bearing), r * math.sin(bearing)), radius, owner=3)
    seen = swept(drawing)
    angles = -HALF + np.arange(1081) * math.radians(0.25)
    off = np.abs(angles - bearing)
    inside = off < math.asin(radius / r) - 1e-9
    assert np.array_equal(np.isfinite(seen.ranges), inside)
    assert np.all(seen.owners == np.where(inside, 3, NOBODY))
    nearest = r * np.cos(off[inside]) - np.sqrt(radius**2 - (r * np.sin(off[inside])) ** 2)
    assert seen.ranges[inside] == pytest.approx(nearest, abs=1e-9)


def test_the_nearer_thing_hides_the_farther_one_whatever_was_drawn_first() -> None:
    for order in (1, -1):
        drawing = Drawing()
        for x, owner in [(2.0, 1), (3.0, 2)][::order]:
            drawing.box((x, 0, 0.3), 0.2, 0.4, owner)
        seen = swept(drawing)
        assert seen.owners[540] == 1
        assert not np.any(seen.owners == 2)


def test_a_walking_leg_is_sheared_by_its_way_during_the_sweep() -> None:
    drawing = Drawing()
    drawing.circle((2.0, 0.0), 0.05, 1, velocity=(0.0, 1.5))
    at_once, in_time = swept(drawing), swept(drawing, increment_s=1e-4)
    # The middle beam comes 54 ms after the first: by then the leg is 8 cm to the left.
    shift = np.mean(np.flatnonzero(in_time.owners == 1)) - np.mean(np.flatnonzero(at_once.owners == 1))
    assert math.radians(0.25 * shift) * 2.0 == pytest.approx(1.5 * 1e-4 * (540 + shift), abs=0.01)


def test_a_mirror_shows_the_room_in_front_of_it_at_the_length_of_the_whole_way() -> None:
    drawing = Drawing()
    drawing.segment((2.0, -1.0), (2.0, 1.0), material=MIRROR)
    drawing.circle((1.0, 0.5), 0.05, owner=1)
    seen = swept(drawing)
    bearing = math.atan2(0.5, 3.0)  # of the image behind the mirror
    beam = round((bearing + HALF) / math.radians(0.25))
    assert seen.owners[beam] == 1
    assert seen.ranges[beam] == pytest.approx(math.hypot(3.0, 0.5) - 0.05, abs=1e-3)
    assert np.isinf(seen.ranges[540])  # straight back there is nothing: the laser does not see itself


# errors


def still(range_m: float, beams: int = 1081, cosine: float = 1.0, echo: float = 1.0) -> Cast:
    full = np.full(beams, range_m)
    owners = np.zeros(beams, dtype=np.int64)
    return Cast(full, np.full(beams, cosine), owners, np.full(beams, 0.5), np.full(beams, echo))


def measured(seen: Cast, scans: int = 400, laser: Laser = FINE, seed: int = 0, **noise: Any) -> Any:
    laser = replace(laser, beams=len(seen.ranges), noise=replace(laser.noise, **noise))
    errors = LaserErrors(laser, np.random.default_rng(seed))
    return np.array([errors.measure(seen, 0.1 * k).ranges for k in range(scans)])


CLEAN: dict[str, Any] = {
    "isolated": 0.0, "intermittent": 0.0, "error_code": 0.0, "warm_up_m": 0.0, "drift_m": 0.0, "mixed": 0.0,
    "longer": 0.0,
}  # fmt: skip


@pytest.mark.parametrize(("range_m", "low", "high"), [(1.0, 3.0, 4.2), (2.5, 3.0, 4.5), (3.5, 5.5, 8), (5.0, 8, 12)])
def test_noise_is_as_large_as_on_recordings(range_m: float, low: float, high: float) -> None:
    off = measured(still(range_m), **CLEAN) - range_m
    assert low <= 1e3 * off.std() <= high
    common = off.mean(axis=1).std() * 1e3
    assert 0.7 <= common <= 1.5
    assert 1.3 <= (measured(still(range_m, cosine=0.17), **CLEAN) - range_m).std() / off.std() <= 2.5


def test_each_device_measures_everything_too_long_or_too_short_all_its_life() -> None:
    noise = {name: value for name, value in CLEAN.items() if name != "longer"}
    shares = []
    for seed in range(40):
        near, far = (measured(still(r), scans=20, seed=seed, **noise).mean() / r - 1 for r in (1.0, 4.0))
        assert near == pytest.approx(far, abs=0.001)
        shares.append(far)
    assert max(np.abs(shares)) < 0.0125
    assert 0.005 < np.std(shares) < 0.009  # of five shared samples 0.0075


def test_noise_of_neighbours_and_of_scans_that_follow_belongs_together_as_on_recordings() -> None:
    off = measured(still(2.0), **CLEAN, common_m=0.0) - 2.0
    off -= off.mean(axis=0)

    def together(a: Any, b: Any) -> float:
        return float((a * b).mean() / off.var())

    assert 0.5 <= together(off[:, 1:], off[:, :-1]) <= 0.6
    assert 0.14 <= together(off[:, 2:], off[:, :-2]) <= 0.36
    assert abs(together(off[:, 5:], off[:, :-5])) < 0.02
    assert 0.03 <= together(off[1:], off[:-1]) <= 0.17


def test_some_beams_fall_silent_and_stay_so_others_only_now_and_then() -> None:
    ranges = measured(still(2.0), scans=1500)
    silent = np.isinf(ranges)
    share = silent.mean(axis=0)
    bad, good = share > 0.1, share < 0.05
    assert 0.01 < bad.mean() < 0.06 and (bad | good).all()
    after = silent[1:, bad][silent[:-1, bad]].mean(), silent[1:, bad][~silent[:-1, bad]].mean()
    assert 0.53 <= after[0] <= 0.94 and 0.09 <= after[1] <= 0.30
    assert 0.0005 <= silent[:, good].mean() <= 0.009
    assert 0 < np.isnan(ranges).mean() < 0.001
    finite = ranges[np.isfinite(ranges)]
    assert np.abs(finite * 1000 - np.round(finite * 1000)).max() < 1e-6  # whole millimetres


def test_at_an_edge_few_beams_lie_between_the_two_sides() -> None:
    seen = still(2.0)
    seen.ranges[540:] = 4.0
    between = np.abs(measured(seen, scans=3000) - 3.0)[:, 538:542] < 0.9
    assert 0.02 <= between.any(axis=1).mean() <= 0.11


def test_black_things_nearly_never_echo_and_nothing_echoes_beyond_reach() -> None:
    assert np.isfinite(measured(still(2.0, echo=BLACK.echo), **CLEAN)).mean() == pytest.approx(BLACK.echo, abs=0.01)
    assert np.isinf(measured(still(6.0), laser=COARSE, **CLEAN)).all()
    assert np.isnan(measured(still(0.001), **CLEAN)).any()


@pytest.mark.parametrize(
    ("range_m", "low", "high"), [(2.5, 0.97, 1.0), (3.7, 0.7, 0.9), (4.2, 0.4, 0.6), (5.2, 0.0, 0.1)]
)
def test_echoes_of_a_faint_laser_are_lost_at_a_distance_as_in_the_shared_samples(
    range_m: float, low: float, high: float
) -> None:
    """Of robots, which are as bright; black things are lost nearer."""
    seen = still(range_m)
    assert np.isfinite(measured(seen, laser=COARSE, **CLEAN)).all()
    share = np.isfinite(measured(seen, laser=FAINT, **CLEAN)).mean()
    assert low <= share <= high
    seen.reflectivity[:] = 0.15
    assert np.isfinite(measured(seen, laser=FAINT, **CLEAN)).mean() < min(share, 0.6)


def test_ranges_drift_by_millimetres_in_minutes() -> None:
    laser = replace(FINE, beams=50, noise=replace(FINE.noise, isolated=0, intermittent=0, error_code=0))
    ends = []
    for seed in range(40):
        errors = LaserErrors(laser, np.random.default_rng(seed))
        means = [errors.measure(still(2.0, 50), t).ranges.mean() for t in np.arange(0, 3600, 30.0)]
        assert np.abs(np.diff(means)).max() < 0.008
        ends.append(np.ptp(means))
    assert 0.002 < np.mean(ends) < 0.015


def test_scans_come_a_little_out_of_time_and_a_few_are_missing() -> None:
    errors = LaserErrors(FINE, np.random.default_rng(1))
    periods = np.array([errors.period() for _ in range(20_000)]) / FINE.period_s
    assert 0.001 < (periods > 1.5).mean() < 0.006
    assert set(np.round(periods)) >= {1, 2, 3}
    jitter = np.array([errors.jitter() for _ in range(2000)])
    assert jitter.std() == pytest.approx(0.001, rel=0.1)


def test_the_reported_pose_is_off_by_so_much() -> None:
    mount = misplaced("A", FINE, (1.0, 2.0, 3.0), np.random.default_rng(2), 0.012, 0.3)
    assert math.dist(mount.pose[:2], mount.reported[:2]) == pytest.approx(0.012)
    assert abs(math.remainder(mount.pose[2] - mount.reported[2], 2 * math.pi)) == pytest.approx(math.radians(0.3))


def test_intensity_tells_bright_from_dark() -> None:
    seen = still(2.0)
    errors = LaserErrors(FINE, np.random.default_rng(3))
    light = errors.measure(seen, 0.0).intensities
    seen.reflectivity[:] = Material(0.1).reflectivity
    assert np.median(light) > 3 * np.median(errors.measure(seen, 0.1).intensities) > 0
    assert NoiseParameters().quantum_m == 0.001
