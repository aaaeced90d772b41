"""Where blocks of samples begin and end."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tms_agents.cabinet.blocks import Blocks
from tms_agents.cabinet.settings import EstimatorSettings


def blocks_of(samples, period_s: float = 0.02):
    blocks = Blocks(samples.shape[1], EstimatorSettings())
    done = [blocks.push(n * period_s, grams.tolist()) for n, grams in enumerate(samples)]
    return [one[0] for one in done if one is not None]


def noise(seconds: float, seed: int = 1):
    return np.random.default_rng(seed).normal(0.0, 4.0, (round(seconds * 50), 4))


def test_at_rest_all_blocks_are_of_the_same_length():
    assert {block.n for block in blocks_of(noise(60.0))} == {4}


def test_no_sample_is_lost_between_blocks():
    blocks = blocks_of(noise(8.0))
    assert all(later.start == pytest.approx(one.end + 0.02) for one, later in itertools.pairwise(blocks))
    assert sum(block.n for block in blocks) > 396
