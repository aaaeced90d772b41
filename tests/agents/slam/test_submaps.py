"""Submaps rendered side by side are those rendered alone; loops close alike for any number of threads."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from tms_agents.slam import Settings
from tms_agents.slam.backend import close_loops
from tms_agents.slam.geometry import between
from tms_agents.slam.gridmap import grid_map, render
from tms_agents.slam.keyframes import KeyScans
from tms_agents.slam.submaps import GROUP, Submaps


@pytest.fixture(scope="module")
def keys(log):
    return KeyScans(log.odometry, log.driven, [log.points(n) for n in range(len(log))], log.laser[:2])


def test_side_by_side_as_alone(driven, keys):
    submaps = Submaps(driven.truth, keys, Settings())
    assert len(submaps) > GROUP
    for number in (0, 3, GROUP, len(submaps) - 1):
        mine = np.arange(submaps.first[number], submaps.first[number + 1])
        relative = between(driven.truth[submaps.anchors[number]][None], driven.truth[mine])
        alone = grid_map(render(relative, [keys.scans[k] for k in mine], keys.laser, 0.05, 0.5), 0)
        together = grid_map(submaps.rendered(number // GROUP), number % GROUP)
        # Their rectangles begin elsewhere, so a point on the edge of a cell may be rounded into the next one.
        assert np.mean(together.cells != alone.cells) < 1e-3
        np.testing.assert_allclose(together.origin, alone.origin, atol=1e-9)


def test_loops_close_alike_for_any_number_of_threads(log, keys):
    closed = []
    for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
        numba.set_num_threads(threads)
        closed.append(close_loops(log.odometry, keys, Settings()))
    np.testing.assert_array_equal(closed[0].path, closed[1].path)
    assert closed[0].believed == closed[1].believed > 0
