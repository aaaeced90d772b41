"""How brightly feet echo."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.segmentation import CLUSTER
from tms_agents.floor.shine import learn, measure, unlike
from tms_agents.floor.state import BODY, empty

VARIANCE = 0.01


def marks_of(ranges: np.ndarray, intensities: np.ndarray) -> np.ndarray:
    clusters = np.zeros(1, CLUSTER)
    clusters["last"], clusters["near"] = len(ranges) - 1, ranges.mean()
    marks = np.zeros((1, 3))
    measure(clusters, ranges, intensities, 1e-4, marks)
    return marks[0]


def people(*brightness: float):
    bodies = empty(BODY, len(brightness))
    for body, value in zip(bodies, brightness, strict=True):
        body["used"] = body["confirmed"] = 1
        body["seen"] = body["sure"] = 1.0
        for _ in range(400):
            learn(body, value, VARIANCE)
    return bodies


def test_the_same_shoe_is_as_bright_near_and_far() -> None:
    near = marks_of(np.full(9, 1.0), np.full(9, 900.0))
    far = marks_of(np.full(9, 4.0), np.full(9, 900.0 * 4.0**-0.287))
    assert near[0] == pytest.approx(far[0])


def test_a_sensor_without_intensities_tells_people_not_apart() -> None:
    marks = marks_of(np.full(9, 1.0), np.zeros(0))
    assert np.isnan(marks[0])
    assert unlike(people(7.0)[0], marks[0], marks[1]) == 0.0


def test_somebody_of_another_brightness_is_less_likely() -> None:
    (body,) = people(7.0)
    assert unlike(body, 7.0, VARIANCE) < 0.0 < unlike(body, 6.3, VARIANCE)


def test_what_is_known_of_a_name_that_is_unsure_stays() -> None:
    (body,) = people(7.0)
    body["sure"] = 0.3
    for _ in range(80):
        learn(body, 6.3, VARIANCE)
    assert body["own"] == pytest.approx(7.0)
    assert body["look"] < 6.7
