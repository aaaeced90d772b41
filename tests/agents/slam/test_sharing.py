"""Every piece of a shared loop is done once, whoever is slow."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit, prange

from tms_agents.slam.sharing import queue, take


@njit(parallel=True)
def add_up(costs, done, sums):
    line = queue(len(costs))
    for begin in prange(len(costs)):
        n = take(line, begin)
        while n < len(costs):
            for k in range(costs[n]):
                sums[n] += np.sin(k)
            done[n] += 1
            n = take(line, n)


@pytest.mark.parametrize("threads", [1, numba.config.NUMBA_NUM_THREADS])
@settings(max_examples=25)
@given(costs=st.lists(st.sampled_from([0, 1, 100, 20_000]), max_size=70))
def test_each_piece_is_done_once(threads, costs):
    numba.set_num_threads(threads)
    done, sums = np.zeros(len(costs), dtype=np.int64), np.zeros(len(costs))
    add_up(np.array(costs, dtype=np.int64), done, sums)
    assert (done == 1).all()
    np.testing.assert_allclose(sums, [np.sin(np.arange(cost)).sum() for cost in costs], atol=1e-9)


def test_pieces_are_given_from_a_place_on_and_around():
    line = queue(5)
    assert [take_one(line, first) for first in (3, 3, 3, 3, 0, 0)] == [3, 4, 0, 1, 2, 5]


@njit
def take_one(line, first):
    return take(line, first)
