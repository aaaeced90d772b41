"""The paper's filter: what it can know, its determinism and its state files."""

import json
import math
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_schemas.scenario import read_scenario
from tms_server.placement import DrawKey, Engine, PaperFilter
from tms_server.placement.replay import scenario_filter

from .worlds import WorldMaker


def paper(seed: int, individuals: int = 50) -> tuple[PaperFilter, list]:  # type: ignore[type-arg]
    scenario = read_scenario(json.dumps(WorldMaker(Random(seed), events=12).scenario))
    belief = scenario_filter(scenario, "paper", "paper", individuals, seed=3)
    assert isinstance(belief, PaperFilter)
    return belief, scenario.events


@given(st.integers(0, 2**32))
@settings(max_examples=60)
def test_it_survives_every_event_and_a_restart(seed: int) -> None:
    one, events = paper(seed)
    two, _ = paper(seed)
    for i, event in enumerate(events):
        one.apply(event, DrawKey(1, "a", i))
        two = PaperFilter.from_bytes(two.to_bytes())
        two.apply(event, DrawKey(1, "a", i))
        assert one.marginals() == two.marginals()
        for pie in one.marginals().values():
            assert math.fsum(pie.values()) == pytest.approx(1.0)
    assert one.to_bytes() == two.to_bytes()


def test_a_state_of_another_filter_is_refused() -> None:
    belief, _ = paper(1)
    with pytest.raises(ValueError, match="paper"):
        Engine.from_bytes(belief.to_bytes())
