"""The exact engine against the brute-force oracle, on random scenarios that reach every rule."""

import json
import math
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_schemas.scenario import read_scenario
from tms_server.placement import DrawKey, Engine
from tms_server.placement.replay import scenario_filter

from .oracle import Oracle
from .worlds import WorldMaker

MOST = 20_000


def compare(scenario: dict[str, Any], budget: int | None = None) -> None:
    parsed = read_scenario(json.dumps(scenario))
    oracle = Oracle(scenario)
    engine = scenario_filter(parsed, "exact" if budget is None else "particle", particles=budget)
    assert isinstance(engine, Engine)
    same(engine, oracle, "start")
    for i, (event, raw) in enumerate(zip(parsed.events, scenario["events"], strict=True)):
        log_evidence, contradiction = oracle.apply(raw)
        info = engine.apply(event, DrawKey(0, "test", i))
        assert info.contradiction == contradiction, (i, raw)
        assert info.log_evidence == pytest.approx(log_evidence, abs=1e-9, rel=1e-12), (i, raw)
        same(engine, oracle, (i, raw))
        if len(oracle.belief) > MOST:
            return


def same(engine: Engine, oracle: Oracle, where: object) -> None:
    mine, theirs = engine.marginals(), oracle.marginals()
    assert engine.n_hypotheses == len(oracle.belief), where
    for o, expected in theirs.items():
        assert math.fsum(mine[o].values()) == pytest.approx(1.0, abs=1e-12), where
        for label in set(expected) | set(mine[o]):
            assert mine[o].get(label, 0.0) == pytest.approx(expected.get(label, 0.0), abs=1e-9), (where, o)


@given(st.integers(0, 2**32))
@settings(max_examples=300)
def test_random_scenarios_equal_the_oracle(seed: int) -> None:
    compare(WorldMaker(Random(seed)).scenario)


@pytest.mark.parametrize("seed", range(40))
def test_long_scenarios_equal_the_oracle(seed: int) -> None:
    compare(WorldMaker(Random(f"long {seed}"), events=20).scenario)
