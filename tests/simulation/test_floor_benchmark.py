"""The benchmark of floor sensing: the yardstick does what was published of it, the tables say what was measured."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def benchmark() -> Iterator[Any]:
    sys.path.insert(0, str(BENCHMARKS))
    try:
        import floor

        yield floor
    finally:
        sys.path.remove(str(BENCHMARKS))


def laboratory(benchmark: Any, things: list[tuple[float, float, float]], seconds: float, wall_m: float = 4.0) -> Any:
    """The yardstick before a round wall; ``things`` (x, y, radius) appear after six seconds."""
    from floor_laboratory import LaboratoryFloor

    angles = np.radians(np.arange(-135, 135.1, 0.25))
    floor = LaboratoryFloor(angles, (0.0, 0.0, 0.0))
    rng = np.random.default_rng(0)
    for k in range(round(10 * (6 + seconds))):
        ranges = np.full(len(angles), wall_m)
        for x, y, radius in things if k >= 60 else []:
            bearing, distance = np.arctan2(y, x), np.hypot(x, y)
            ranges[np.abs(angles - bearing) < np.arcsin(radius / distance)] = distance - radius
        floor.scan(0.1 * k, ranges + rng.normal(0, 0.003, len(angles)))
    return floor


def test_the_laboratory_finds_a_thing_after_five_seconds_but_none_that_is_small_or_before_a_wall(
    benchmark: Any,
) -> None:
    assert not [one for one in laboratory(benchmark, [(2, 0, 0.08)], 4.0).labels() if one["attr"] == "object"]
    (label,) = laboratory(benchmark, [(2, 0, 0.08)], 7.0).labels()
    assert label["attr"] == "object" and label["x"] == pytest.approx(1.93, abs=0.03)
    for hidden in [(3.0, 0.0, 0.015), (3.97, 0.0, 0.05)]:  # 2 beams; its front 8 cm before the wall
        assert not laboratory(benchmark, [hidden], 9.0).labels()


def test_one_world_is_judged_and_shown(benchmark: Any, capsys: pytest.CaptureFixture[str]) -> None:
    job = benchmark.Job("one", "legs", 1, "ours", duration=25.0)
    outcome = benchmark.judged(job)
    assert outcome.scores.movers.people == 1 and outcome.scores.movers.needed > 80
    assert outcome.scores.movers.idf1 > 0.5
    benchmark.look(job)
    assert "objects: recall nan" in capsys.readouterr().out


def test_the_tables_hold_what_is_asked_for(benchmark: Any) -> None:
    from floor_tables import movers_table, objects_table, requirements_table

    scores = [benchmark.judged(benchmark.Job("things", "prints", 1, "laboratory", duration=40.0)).scores]
    every = {("unseen", "things", "prints"): scores}
    lines = requirements_table(every).splitlines()
    assert lines[2] == "| asked for | unseen, prints |"
    assert any(line.startswith("| recall >= 0.8 of 3 cm | ") for line in lines)
    found = objects_table({("things", "prints", "laboratory"): scores}).splitlines()
    cells = found[2].split(" | ")
    assert len(cells) == len(found[0].split(" | ")) and cells[0] == "| things"
    assert len(movers_table({("things", "prints", "laboratory"): scores}).splitlines()) == 3


@pytest.mark.parametrize("wrong", [["--look", "nothing"], ["--contestants", "ours,theirs"], ["--count", "0"]])
def test_a_wrong_word_is_one_clear_line(benchmark: Any, capsys: pytest.CaptureFixture[str], wrong: list[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        benchmark.main(wrong)
    assert stopped.value.code == 2
    assert f"{wrong[1].split(',')[-1]}" in capsys.readouterr().err.splitlines()[-1]


def test_feet_that_land_near_others_are_mostly_likeliest_their_owners(benchmark: Any) -> None:
    from floor_feet import choices
    from floor_told import Job

    landings = choices(Job("three close", 1, "prints", "coarse"), 45.0)
    assert len(landings) > 30 and all(sum(one.owner for one in choice.candidates) == 1 for choice in landings)
    assert sum(choice.right for choice in landings) > 0.7 * len(landings)


def test_the_fit_begins_with_what_the_estimator_makes_of_a_landing(benchmark: Any) -> None:
    import floor_landing
    from floor_feet import choices
    from floor_told import Job

    seen = [one for choice in choices(Job("three close", 1, "prints", "coarse"), 45.0) for one in choice.candidates]
    landed = [one for one in seen if one.lands]
    pairs = [floor_landing.Choice(1, [replace(one, owner=True), replace(one, owner=False)]) for one in landed]
    costs = floor_landing._costs(floor_landing._start(), floor_landing._Data(pairs))
    assert len(landed) > 30
    assert costs == pytest.approx(np.repeat([one.cost for one in landed], 2))


def test_the_fit_makes_owners_likelier_than_the_numbers_it_begins_with(
    benchmark: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    from floor_landing import Candidate, Choice, fit

    rng = np.random.default_rng(3)
    made = []
    for seed in range(120):
        # Whoever has put it down is expected half a step farther on than the model has it.
        states = [(rng.normal(off, 0.1), rng.normal(0.0, 0.1), 0.5, 1.0, 0.01, 0.6, 0.45, 0.5) for off in (0.5, 0.26)]
        made.append(Choice(seed, [Candidate(5.0, 0.0, i == 0, True, True, state) for i, state in enumerate(states)]))
    fit(made)
    told = capsys.readouterr().out
    kept = {line.split(":")[0]: float(line.split("kept aside ")[1].split(" ")[0]) for line in told.splitlines()[1:3]}
    assert told.startswith("fitting 36 numbers to 90 choices; 30 kept aside")
    assert kept["fitted"] < 0.7 * kept["as it is"]


def test_the_fit_of_places_finds_the_numbers_it_was_made_with(benchmark: Any) -> None:
    from floor_places import Samples, added, fit

    from tms_agents.floor.feet.place import TERMS

    rng = np.random.default_rng(4)
    n = 4000
    samples = Samples(
        rng.integers(0, len(TERMS), n),
        rng.uniform(0.0, 1.5, n),
        rng.normal(0.0, 0.5, (n, TERMS.shape[1], 2)),
        np.zeros((n, 2)),
        np.zeros((n, 2)),
        rng.uniform(size=n) < 0.3,
    )
    terms = TERMS + rng.normal(0.0, 0.3, TERMS.shape)
    away = -added(samples, terms) + rng.normal(0.0, 0.05, (n, 2))
    assert np.abs(fit(replace(samples, filtered=away)) - terms).max() < 0.03


def test_people_in_shoes_are_watched_as_they_walk(benchmark: Any) -> None:
    from floor_places import watched

    rows = watched(("one", 1502, "fine"))
    filtered, told = (np.array([row[k] for row in rows]) for k in (3, 4))
    assert len(rows) > 100
    assert np.mean(told**2) < np.mean(filtered**2)
