"""How brightly feet echo."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.feet.brightness import expected, learn, measure, scatter, unlike
from tms_agents.floor.scan.segmentation import CLUSTER
from tms_agents.floor.state import BODY, empty

VARIANCE = 0.01


def marks_of(ranges: np.ndarray, intensities: np.ndarray) -> np.ndarray:
    clusters = np.zeros(1, CLUSTER)
    clusters["last"], clusters["near"] = len(ranges) - 1, ranges.mean()
    marks = np.zeros((1, 4))
    measure(clusters, ranges, intensities, 1e-4, expected(), marks)
    return marks[0]


def mark(value: float) -> np.ndarray:
    return np.array([value, VARIANCE, 0.0, 0.5])


def people(*brightness: float):
    bodies = empty(BODY, len(brightness))
    for body, value in zip(bodies, brightness, strict=True):
        body["used"] = body["confirmed"] = 1
        body["seen"] = body["sure"] = 1.0
        for _ in range(400):
            learn(body, value)
    return bodies


def test_the_same_shoe_is_as_bright_near_and_far() -> None:
    near = marks_of(np.full(9, 1.0), np.full(9, 900.0))
    far = marks_of(np.full(9, 4.0), np.full(9, 900.0 * 4.0**-0.287))
    assert near[0] == pytest.approx(far[0])


def test_a_sensor_without_intensities_tells_people_not_apart() -> None:
    marks = marks_of(np.full(9, 1.0), np.zeros(0))
    assert np.isnan(marks[0])
    assert unlike(people(7.0)[0], marks) == 0.0


def test_somebody_of_another_brightness_is_less_likely() -> None:
    (body,) = people(7.0)
    assert unlike(body, mark(7.0)) < 0.0 < unlike(body, mark(6.3))


def test_what_is_known_of_a_name_that_is_unsure_stays() -> None:
    (body,) = people(7.0)
    body["sure"] = 0.3
    for _ in range(80):
        learn(body, 6.3)
    assert body["own"] == pytest.approx(7.0)
    assert body["look"] < 6.7


def watched(deviation: float, beside: float = 3.0) -> np.ndarray:
    """What is learned of the scatter from somebody whose shoe looks up to ``deviation`` brighter or darker."""
    bodies = people(7.0, 7.0)
    bodies["x"][1] = beside
    bodies["a_print"], bodies["b_print"] = (0, 2), (1, 3)
    clusters, learned = np.zeros(1, CLUSTER), expected()
    random = np.random.default_rng(1)
    for scan in range(600):
        t = 0.1 * scan
        bodies["seen"] = t
        marks = np.array([[7.0 + deviation * random.normal(), learned[0] * VARIANCE, 0.0, 0.5]])
        learn(bodies[0], marks[0, 0])
        scatter(bodies, clusters, np.array([0]), marks, t, learned)
    return learned


def test_even_shoes_tell_people_apart_the_better_once_they_are_known_to_be_even() -> None:
    even, uneven = watched(0.03), watched(0.2)
    assert even[0] < 0.3 < 1.5 < uneven[0]
    assert even[1] < expected()[1]


def test_nothing_is_learned_of_brightness_from_people_side_by_side() -> None:
    assert watched(0.03, beside=0.5).tolist() == expected().tolist()
