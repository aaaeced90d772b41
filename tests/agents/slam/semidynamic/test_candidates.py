"""Poses that are tried: also those at which the tag is turned away, and those that look alike to a laser."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.slam.geometry import Floats, transform, wrapped
from tms_agents.slam.semidynamic.candidates import candidates
from tms_agents.slam.semidynamic.evidence import CELL_M, Beams, Place, worth
from tms_agents.slam.semidynamic.models import Antenna, ObjectModel
from tms_agents.slam.semidynamic.scoring import Heard, Sight
from tms_agents.slam.semidynamic.shapes import shape_of

MODEL = ObjectModel(
    "cabinet", (np.array([(-0.22, -0.3), (0.22, -0.3), (0.22, 0.3), (-0.22, 0.3)]),), np.array([0.22, 0.0, 0.0])
)
ANTENNA = Antenna(np.zeros(3), 2.0, np.pi / 3)
READER = np.array([-1.0, 0.0, 0.0])


def sight(pose: Floats) -> Sight:
    """A cabinet at ``pose`` in the open, all of it seen from the reader's side; its tag was read twice."""
    shape = shape_of(MODEL)
    place = Place(np.array([-3.0, -3.0]), 240, 240)
    points = np.repeat(transform(pose, shape.outline), 8, axis=0)
    course = points - READER[:2]
    normals = np.repeat(transform(np.array([0.0, 0.0, pose[2]]), shape.normals), 8, axis=0)
    faced = (normals * course).sum(axis=1) < 0
    points, course = (points[faced] - place.corner) / CELL_M, course[faced]
    hits, ends, courses = np.zeros((240, 240), dtype=np.int32), np.zeros((240, 240, 2)), np.zeros((240, 240, 2))
    cells = points.astype(int)
    np.add.at(hits, (cells[:, 1], cells[:, 0]), 1)
    np.add.at(ends, (cells[:, 1], cells[:, 0]), points)
    np.add.at(courses, (cells[:, 1], cells[:, 0]), course / np.linalg.norm(course, axis=1, keepdims=True))
    nothing = Beams(np.zeros_like(hits), np.zeros_like(hits), np.zeros_like(ends), np.zeros_like(ends))
    heard = [Heard(ANTENNA, np.tile(READER, (2, 1)), read=True)]
    return Sight(place, worth(Beams(hits, np.zeros_like(hits), courses, ends), nothing), heard)


@pytest.mark.parametrize("turn", [0.0, 0.4, 2.8, -2.0])
def test_where_it_stands_is_a_candidate_however_its_tag_is_turned(turn: float) -> None:
    pose = np.array([0.2, 0.1, turn])
    found, _ = candidates(sight(pose), MODEL, shape_of(MODEL), np.random.default_rng(1))
    off = np.hypot(*(found[:, :2] - pose[:2]).T)
    assert ((off < 0.06) & (np.abs(wrapped(found[:, 2] - turn)) < 0.15)).any()


def test_the_same_outline_with_the_tag_on_the_other_side_is_a_candidate() -> None:
    found, scores = candidates(sight(np.array([0.2, 0.1, 2.8])), MODEL, shape_of(MODEL), np.random.default_rng(1))
    turned = np.abs(wrapped(found[:, 2] - 2.8)) > 3.0
    same_place = np.hypot(*(found[:, :2] - [0.2, 0.1]).T) < 0.06
    assert (turned & same_place).any()
    assert (np.diff(scores) <= 0).all()
