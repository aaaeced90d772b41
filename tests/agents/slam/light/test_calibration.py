"""The table takes distance and angle out of the light, whatever the amplifier, and leaves the surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.slam.light.calibration import learn
from tms_agents.slam.light.scans import LightError, calibrated, contrast, light_scans
from tms_agents.slam.light.surfaces import surfaces

ORIGIN = np.zeros(2)


@given(
    st.floats(-np.pi, np.pi), st.floats(0.5, 3.0), st.floats(-0.9, 0.9), st.integers(0, 2**16)
)  # fmt: skip
@settings(max_examples=40)
def test_a_wall_is_met_at_its_angle(heading, distance, turn, seed):
    """A beam along ``heading`` meets a wall whose normal is turned by ``turn``."""
    random = np.random.default_rng(seed)
    angles = heading + np.radians(np.arange(-3.0, 3.0, 0.5))
    normal = heading + turn
    ranges = distance * np.cos(turn) / np.cos(angles - normal) + random.normal(0, 0.001, len(angles))
    points = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)
    tangents, incidence = surfaces(points, ORIGIN)
    middle = len(angles) // 2
    assert incidence[middle] == pytest.approx(abs(turn), abs=0.06)
    along = abs(tangents[middle] @ np.array([-np.sin(normal), np.cos(normal)]))
    assert along == pytest.approx(1.0, abs=0.01)


def test_points_that_make_no_line_have_no_angle():
    alone = np.array([[1.0, 0.0], [1.0, 2.0], [-3.0, 0.5]])
    tangents, incidence = surfaces(alone, ORIGIN)
    assert np.isnan(incidence).all()
    assert np.isnan(tangents).all()


def beams(seed: int = 0, count: int = 6000):
    random = np.random.default_rng(seed)
    ranges, incidence = random.uniform(0.4, 4.0, count), random.uniform(0.0, 1.35, count)
    colours = random.choice([0.2, 0.5, 0.5, 0.9], count // 20)
    reflectance = np.repeat(colours, 20)
    received = reflectance * np.cos(incidence) ** 0.7 / (1.0 + ranges**2)
    return ranges, incidence, 3000.0 * received**0.8 * np.exp(random.normal(0, 0.05, count)), reflectance


def test_what_is_left_is_the_surface():
    ranges, incidence, intensities, reflectance = beams()
    light, deviation = learn(ranges, incidence, intensities).normalised(ranges, incidence, intensities)
    assert np.corrcoef(light, np.log(reflectance))[0, 1] > 0.98
    assert abs(np.corrcoef(light, ranges)[0, 1]) < 0.05
    assert abs(np.corrcoef(light, incidence)[0, 1]) < 0.05
    assert np.median(deviation) == pytest.approx(0.05, rel=0.4)


@given(st.floats(1e-3, 1e3))
@settings(max_examples=8)
def test_the_unit_of_intensity_does_not_matter(gain):
    ranges, incidence, intensities, _ = beams(1, 2000)
    light, deviation = learn(ranges, incidence, intensities).normalised(ranges, incidence, intensities)
    other, as_sure = learn(ranges, incidence, gain * intensities).normalised(ranges, incidence, gain * intensities)
    np.testing.assert_allclose(other, light, atol=1e-6)
    np.testing.assert_allclose(as_sure, deviation, atol=1e-6)


def test_colours_are_seen_in_the_contrast(coloured, plain):
    found = [contrast(light_scans(log, np.arange(0, len(log), 20), calibrated(log))) for _, log in (coloured, plain)]
    assert found[0] > 3.0
    assert found[1] == pytest.approx(1.0, abs=0.2)


def test_a_log_without_light_says_so(log):
    with pytest.raises(LightError, match="no received light"):
        calibrated(log)
    with pytest.raises(ValueError, match="only 0 beams"):
        learn(np.ones(9), np.zeros(9), np.zeros(9))
