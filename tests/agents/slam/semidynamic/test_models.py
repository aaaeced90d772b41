"""What the object database tells: read, or refused with a reason."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.slam import LogError
from tms_agents.slam.semidynamic import Antenna, parse_models, parse_rounds
from tms_agents.slam.semidynamic.antenna import detection
from tms_agents.slam.semidynamic.shapes import shape_of

BOX = [[-0.15, -0.15], [0.15, -0.15], [0.15, 0.15], [-0.15, 0.15]]


def document(**changes: Any) -> dict[str, Any]:
    antenna = {"id": 0, "pose": [0.15, 0, 0], "nominal_max_range": 2.0, "nominal_half_beam": 1.0}
    tag = {"class": "bin_box", "tag_pose": [0.15, 0, 0], "parts": [BOX]}
    return {"robot": {"laser_pose": [0.1, 0, 0], "antennas": [antenna | changes]}, "tags": {"A": tag | changes}}


def test_models_are_read() -> None:
    models = parse_models(json.dumps(document()))
    assert models.antennas[0].reach == 2.0
    assert models.objects["A"].kind == "bin_box"
    assert not models.objects["A"].hinged
    assert not models.objects["A"].turned_alike


@pytest.mark.parametrize(
    "changes",
    [{"nominal_max_range": -1}, {"pose": [1, 2]}, {"parts": []}, {"parts": [[[0, 1, 2]]]}, {"tag_pose": None}],
)
def test_what_is_no_model_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(LogError, match=r"models\.json"):
        parse_models(json.dumps(document(**changes)))


@given(st.lists(st.text(max_size=60)))
def test_lines_that_are_no_rounds_are_left_out(lines: list[str]) -> None:
    good = json.dumps({"t": 1.5, "type": "rfid", "antenna": 1, "tags": [{"id": "A"}]})
    rounds, bad = parse_rounds([*lines, good, '{"type": "rfid", "t": "x"}'])
    assert rounds.t.tolist() == [1.5]
    assert rounds.read("A").tolist() == [True]
    assert bad == 1


@given(st.floats(0.1, 5), st.floats(-3.1, 3.1), st.floats(-3.1, 3.1))
def test_reading_is_less_probable_farther_away(distance: float, bearing: float, facing: float) -> None:
    antenna = Antenna(np.zeros(3), 2.0, 1.0)
    direction = np.array([np.cos(bearing), np.sin(bearing)])
    near, far = (np.array([*(direction * d), facing]) for d in (distance, distance + 0.5))
    p, q = detection(antenna, np.stack([near, far]))
    assert 0 < q <= p < 1


def test_normals_point_outwards_whichever_way_a_polygon_runs() -> None:
    for corners in (BOX, BOX[::-1]):
        text = json.dumps(document(parts=[corners]))
        shape = shape_of(parse_models(text).objects["A"])
        assert ((shape.outline * shape.normals).sum(axis=1) > 0).all()
        assert np.abs(shape.inside).max() < 0.1
        assert shape.size == pytest.approx(0.15 * np.sqrt(2), abs=0.015)
