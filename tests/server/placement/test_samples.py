"""The recorded scenarios with their exact answers."""

import json
from pathlib import Path
from typing import Any

import pytest

from tms_schemas.scenario import Scenario, read_scenario
from tms_server.placement.replay import Filter, Variant, replay

SAMPLES = [
    "s01_paper_experiment", "s03_exit_with_object", "s05_simultaneous_take_two", "s09_tag_false_read",
    "s12_weight_identifies", "s16_floor_occlusion", "s22_idle_ambiguity",
]  # fmt: skip
both = pytest.mark.parametrize("variant", ["full", "paper"])
every = pytest.mark.parametrize("name", SAMPLES)

pytestmark = pytest.mark.realdata


def load(shared_data: Path, name: str, variant: str) -> tuple[Scenario, list[dict[str, Any]]]:
    folder = shared_data / "placement"
    expected = json.loads((folder / f"{name}.expected.json").read_text())
    return read_scenario((folder / f"{name}.json").read_bytes()), expected["variants"][variant]["steps"]


def distances(steps: list[dict[str, Any]], expected: list[dict[str, Any]]) -> list[float]:
    got = {s["event"]: s["marginals"] for s in steps}
    return [
        0.5 * sum(abs(exact.get(k, 0.0) - mine.get(k, 0.0)) for k in set(exact) | set(mine))
        for step in expected
        for obj, exact in step["marginals"].items()
        for mine in [got[step["event"]][obj]]
    ]


@every
@both
def test_exact_equals_the_recorded_answers(shared_data: Path, name: str, variant: Variant) -> None:
    scenario, expected = load(shared_data, name, variant)
    steps = replay(scenario, "exact", variant)["steps"]
    assert max(distances(steps, expected)) < 1e-9
    for mine, exact in zip(steps, expected, strict=True):
        assert mine["log_evidence"] == pytest.approx(exact["log_evidence"], abs=1e-9)
        assert mine["contradiction"] == exact["contradiction"]


@every
@both
@pytest.mark.parametrize(("budget", "goal"), [(1000, 0.001), (30, 0.01)])
def test_particle_is_close(shared_data: Path, name: str, variant: Variant, budget: int, goal: float) -> None:
    scenario, expected = load(shared_data, name, variant)
    for seed in range(3):
        tv = distances(replay(scenario, "particle", variant, budget, seed)["steps"], expected)
        assert sum(tv) / len(tv) <= goal


def test_the_paper_filter_finds_the_pies_of_the_experiment(shared_data: Path) -> None:
    scenario, _ = load(shared_data, "s01_paper_experiment", "paper")
    name: Filter = "paper"
    by_event = {s["event"]: s["marginals"] for s in replay(scenario, name, "paper")["steps"]}
    taken, dropped, handed, last = by_event[4], by_event[6], by_event[8], by_event[12]
    assert all(taken[o]["P1"] > 0.95 for o in "234")
    assert all(dropped[o]["F1"] == pytest.approx(1 / 3, abs=0.06) for o in "234")
    assert handed["2"]["R1"] > 0.9
    assert all(handed[o]["F1"] == pytest.approx(1 / 2, abs=0.12) for o in "34")
    assert min(last["2"]["TB1"], last["3"]["F1"], last["4"]["B10"]) > 0.9
