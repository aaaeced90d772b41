"""The estimator on hand-written signals: what a person does at a board, and what must come out."""

from __future__ import annotations

import json

import numpy as np
import pytest
from cabinet_bench import GEOMETRY, ZONES, Bench, of, share
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.cabinet import (
    Appeared,
    CabinetEstimator,
    EstimatorSettings,
    Identified,
    KnownWeight,
    Moved,
    Vanished,
    Weighed,
    ZoneRead,
)


@given(
    st.integers(0, 2**32 - 1),
    st.integers(4, 12),
    st.lists(st.floats(0.0, 3.0), min_size=4, max_size=40),
)
def test_what_is_put_right_after_the_start_is_weighed_whole(seed: int, before: int, gaps: list[float]) -> None:
    """Two blocks of samples at rest are enough, also where the computer was busy and samples came late."""
    rng = np.random.default_rng(seed)
    estimator = CabinetEstimator(GEOMETRY, zones=ZONES)
    t, events = 0.0, []
    for i in range(before + 60):
        load = 500 * share(0.1, 0.2) if i >= before else np.zeros(4)
        events += estimator.load(t, load + rng.normal(0.0, 0.5, 4))
        t += 0.1 + (gaps[i // 2] if i % 2 and i // 2 < len(gaps) else 0.0)
    (appeared,) = of(Appeared, events)
    assert abs(appeared.weight_g - 500) < 5


@pytest.mark.parametrize("every", [2, 3, 4, 5, 9])
def test_samples_that_are_missing_from_the_start_on_stop_nothing(every: int) -> None:
    estimator, rng, events = CabinetEstimator(GEOMETRY, zones=ZONES), np.random.default_rng(every), []
    for i in range(300):
        load = 500 * share(0.1, 0.2) if i >= 150 else np.zeros(4)
        values = load + rng.normal(0.0, 0.5, 4)
        events += estimator.load(0.1 * i, np.full(4, np.nan) if i < 100 and i % every == 0 else values)
    (appeared,) = of(Appeared, events)
    assert abs(appeared.weight_g - 500) < 5


def test_the_load_is_known_soon_after_the_start() -> None:
    estimator = CabinetEstimator(GEOMETRY, zones=ZONES)
    rng, known = np.random.default_rng(1), []
    for i in range(60):
        estimator.load(i * 0.02, rng.normal(0.0, 0.5, 4))
        known.append(estimator.knows_load)
    assert known == sorted(known) and not known[10] and known[40]


@pytest.mark.parametrize("grams", [25, 60, 300, 2000])
def test_put_and_taken(grams: float) -> None:
    bench = Bench()
    thing = grams * share(0.3, 0.1)
    put = bench.change(thing)
    (appeared,) = of(Appeared, put)
    assert abs(appeared.weight_g - grams) < 4 * appeared.weight_sd_g
    assert np.hypot(appeared.xy[0] - 0.3, appeared.xy[1] - 0.1) < 4 * np.sqrt(appeared.cov[0] + appeared.cov[2])
    (stay,) = bench.estimator.stays()
    assert stay.id == appeared.stay
    (vanished,) = of(Vanished, bench.change(-thing))
    assert vanished.stay == appeared.stay
    assert bench.estimator.stays() == []
    assert of(Appeared, bench.change(thing))[0].stay != appeared.stay, "ids are never used again"


def test_the_place_is_told_again_when_it_is_known_better() -> None:
    bench = Bench(seed=7)
    events = bench.change(300 * share(0.3, 0.1), rest=25.0)
    (appeared,), (again,) = of(Appeared, events), of(Moved, events)
    assert again.stay == appeared.stay
    assert 4 < again.t - appeared.t < 6
    assert again.cov[0] < 0.5 * appeared.cov[0]
    assert again.cov[2] < 0.5 * appeared.cov[2]


def test_what_was_told_by_all_that_happened_gets_better_known_too() -> None:
    """It weighs nothing like the thing whose tag is read: no step tells that, but all that happened does."""
    bench = Bench(seed=9, known={"A": KnownWeight(900, 5)})
    bench.tags = frozenset({"A"})
    events = bench.change(300 * share(0.3, 0.1), rest=9.0)
    (appeared,), (again,) = of(Appeared, events), of(Moved, events)
    assert again.stay == appeared.stay
    assert again.cov[0] < appeared.cov[0]


def test_a_thing_without_a_tag_is_told_within_half_a_second_unless_it_came_slowly() -> None:
    quick, slow = [], []
    for seed in range(8):
        bench = Bench(seed=seed)
        (put,) = of(Appeared, bench.change(300 * share(0.3, 0.1), 0.02))
        quick.append(put.t - 4.02)
        begin = bench.t
        (put,) = of(Appeared, bench.change(300 * share(0.1, 0.2), 1.0))
        slow.append(put.t - (begin + 1.0))
    assert np.median(quick) < 0.5
    assert np.median(slow) > 0.7, "a hand that presses looks like that"


@pytest.mark.parametrize("seed", range(6))
def test_the_weight_is_told_when_no_hand_presses_any_more(seed: int) -> None:
    bench = Bench(seed=seed)
    at = share(0.3, 0.1)
    bench.load = 350 * at
    told = bench.run(0.6)
    bench.load = 300 * at
    told += bench.run(8.0)
    (put,) = of(Appeared, told)
    (weighed,) = of(Weighed, told)
    assert put.pressed and weighed.stay == put.stay
    assert 0.8 < weighed.t - put.t + 0.5 < 3.0
    assert weighed.weight_g == pytest.approx(300, abs=4 * weighed.weight_sd_g + 3)
    assert of(Weighed, bench.run(30.0)) == []


@pytest.mark.parametrize("first", [0.1, 0.3, 0.4])
def test_a_tag_that_was_read_once_is_waited_for(first: float) -> None:
    """A slow reader: what comes at once is not told without the tag that the next round makes sure of."""
    bench = Bench(seed=8)
    begin, told = bench.t, []
    bench.load = 300 * share(0.3, 0.1)
    for i in range(100):
        t = begin + 0.02 * i
        told += bench.estimator.load(t, np.round((bench.load + bench.rng.normal(0.0, 8.0, 4)) / 5) * 5)
        if (i - round(first * 50)) % 25 == 0:
            told += bench.estimator.inventory(t, "shelf", frozenset({"T"} if i >= first * 50 else ()))
    (put,), (tag,) = of(Appeared, told), of(Identified, told)
    assert tag.stay == put.stay and tag.t == pytest.approx(put.t, abs=1e-9)


@pytest.mark.parametrize("seconds", [1.6, 6.0, 40.0])
@pytest.mark.parametrize("why", ["silent", "told", "off"])
def test_a_tag_is_that_of_what_was_put_while_the_board_delivered_nothing(seconds: float, why: str) -> None:
    bench = Bench()
    bench.load, bench.tags = 400 * share(0.2, 0.1), frozenset({"A"})
    if why == "told":  # the line says that the board is gone
        bench.estimator.load(bench.t, np.full(4, np.nan))
    if why == "off":  # so was the agent, and the reader is back before the board
        saved = json.loads(json.dumps(bench.estimator.to_dict()))
        bench.estimator = CabinetEstimator.from_dict(saved, GEOMETRY, zones=ZONES)
    begin = bench.t
    while bench.t < begin + seconds:
        bench.t += 0.2
        bench.events += bench.estimator.inventory(bench.t, "shelf", bench.tags)
    appeared = of(Appeared, bench.run(6.0))
    assert [one.stay for one in appeared] == [one.stay for one in of(Identified, bench.events)]
    assert [one.tag for one in bench.estimator.stays()] == ["A"]


def test_a_weight_that_is_owed_is_told_after_a_restart() -> None:
    bench = Bench(seed=4)
    bench.load = 300 * share(0.3, 0.1)
    told = bench.run(0.6)
    assert of(Appeared, told) and not of(Weighed, told)
    state = json.loads(json.dumps(bench.estimator.to_dict()))
    bench.estimator = CabinetEstimator.from_dict(state, GEOMETRY, zones=ZONES)
    (weighed,) = of(Weighed, bench.run(4.0))
    assert weighed.weight_g == pytest.approx(300, abs=15)


def test_nothing_happens() -> None:
    bench = Bench(seed=3)
    assert bench.run(120.0) == []


def test_a_tag_is_identified_and_one_missed_read_is_no_take() -> None:
    bench = Bench(seed=4)
    bench.tags = frozenset({"T1"})
    (identified,) = of(Identified, bench.change(400 * share(0.1, 0.2), rest=6.0))
    assert identified.tag == "T1"
    assert bench.run(60.0) == []
    assert [stay.tag for stay in bench.estimator.stays()] == ["T1"]


def test_only_a_tag_that_is_read_without_a_stay_is_told_as_read_in_the_zone() -> None:
    bench = Bench(seed=6)
    bench.estimator = CabinetEstimator(GEOMETRY, EstimatorSettings(zone_read_after_s=0.5), zones=ZONES)
    bench.run(4.0)
    bench.tags = frozenset({"T1"})
    bench.change(400 * share(0.1, 0.2))
    bench.tags = frozenset()  # it leaves with the thing; that it is gone shows after four rounds, 0.8 s
    assert of(ZoneRead, bench.change(-400 * share(0.1, 0.2))) == []
    bench.tags = frozenset({"T2"})  # something hangs at the board
    assert [one.tag for one in of(ZoneRead, bench.run(3.0))] == ["T2"]
    bench.tags = frozenset()
    assert [one.tag for one in of(ZoneRead, bench.run(3.0))] == [None]


def test_state_survives_a_restart() -> None:
    bench = Bench(seed=5)
    bench.change(400 * share(0.1, 0.2))
    saved = json.loads(json.dumps(bench.estimator.to_dict()))
    before = bench.estimator.stays()
    bench.estimator = CabinetEstimator.from_dict(saved, GEOMETRY, zones=ZONES)
    assert bench.run(3.0) == []
    assert bench.estimator.stays() == before
    (vanished,) = of(Vanished, bench.change(-400 * share(0.1, 0.2)))
    assert vanished.stay == before[0].id
