"""A beam or two may be all that comes back of a foot far away, or a piece of furniture before a dark wall."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.feet.bodies import scant, update
from tms_agents.floor.scan.segmentation import CLUSTER, DARK
from tms_agents.floor.state import BODY, PRINT, empty


@pytest.mark.parametrize(
    ("is_open", "tells"), [(1, False), (DARK, True), (0, True)], ids=["nothing is known", "a dark wall", "seen past"]
)
def test_only_where_nothing_is_known_what_is_scant_does_not_tell_that_it_is_no_foot(is_open: int, tells: bool) -> None:
    clusters, bodies, prints = np.zeros(1, CLUSTER), empty(BODY, 1), empty(PRINT, 1)
    for name, value in {"x": 4.0, "width": 0.025, "near": 4.0, "spacing": 0.025, "n": 1, "open": is_open}.items():
        clusters[name] = value
    bodies["used"] = bodies["confirmed"] = 1
    bodies["x"] = bodies["ax"] = bodies["bx"] = 4.0
    bodies["quality"], bodies["a_print"], bodies["b_print"] = 1.0, -1, -1
    assert bool(scant(clusters[0])) == (is_open != 0)
    for k in range(60):
        update(bodies[0], clusters[0], True, -1, 0.0, clusters[0], False, -1, 0.0, False, prints, 0.1 * k)
    assert (float(bodies["quality"][0]) < 0.6) == tells
