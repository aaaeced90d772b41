"""The estimator and people: slow and pressing hands, leaning arms, several things, faults of the cells."""

from __future__ import annotations

import numpy as np
import pytest
from cabinet_bench import GEOMETRY, ZONES, Bench, of, share

from tms_agents.cabinet import (
    Appeared,
    CabinetEstimator,
    Geometry,
    Identified,
    KnownWeight,
    LoadChanged,
    Moved,
    Vanished,
    Zone,
    ZoneRead,
)


@pytest.mark.parametrize(("grams", "seconds"), [(300, 2.0), (300, 4.0), (1500, 3.0)])
def test_a_slow_hand_puts_one_thing(grams: float, seconds: float) -> None:
    bench = Bench(seed=11)
    bench.tags = frozenset({"T1"})
    (appeared,) = of(Appeared, bench.change(grams * share(0.2, 0.2), seconds))
    (stay,) = bench.estimator.stays()
    assert stay.id == appeared.stay
    assert abs(stay.weight_g - grams) < 10
    (vanished,) = of(Vanished, bench.change(-grams * share(0.2, 0.2), seconds))
    assert vanished.stay == stay.id


def test_a_pressing_hand_is_not_the_thing() -> None:
    bench = Bench(seed=12, known={"T1": KnownWeight(400, 8)})
    bench.tags = frozenset({"T1"})
    thing, press = 400 * share(0.3, 0.1), 150 * share(0.31, 0.1)
    events = bench.change(thing + press, 0.2, rest=0.5)
    events += bench.change(-press, 0.2)
    (appeared,) = of(Appeared, events)
    assert not of(Vanished, events)
    (stay,) = bench.estimator.stays()
    assert (stay.id, stay.tag) == (appeared.stay, "T1")
    assert abs(stay.weight_g - 400) < 10


def test_a_leaning_arm_leaves_nothing() -> None:
    bench = Bench(seed=13)
    bench.tags = frozenset({"T1"})
    bench.change(400 * share(0.1, 0.2))
    before = bench.estimator.stays()
    arm = share(0.3, 0.03)
    events = bench.run(6.0, lambda s: arm * 700 * min(s, 1, 6 - s) * (1 + 0.15 * np.sin(7 * s) + 0.1 * np.sin(17 * s)))
    events += bench.run(3.0)
    assert {event.stay for event in of(Appeared, events)} == {event.stay for event in of(Vanished, events)}
    assert [stay.id for stay in bench.estimator.stays()] == [stay.id for stay in before]


def test_every_thing_keeps_its_own_place_and_weight() -> None:
    bench = Bench(seed=14)
    places = {"a": (500, 0.1, 0.1), "b": (300, 0.35, 0.1), "c": (800, 0.2, 0.25)}
    for grams, x, y in places.values():
        bench.change(grams * share(x, y))
    stays = bench.estimator.stays()
    for stay, (grams, x, y) in zip(stays, places.values(), strict=True):
        assert abs(stay.weight_g - grams) < 10
        assert np.hypot(stay.xy[0] - x, stay.xy[1] - y) < 0.01
    assert abs(sum(stay.weight_g for stay in stays) - 1600) < 20
    (vanished,) = of(Vanished, bench.change(-300 * share(0.35, 0.1)))
    assert vanished.stay == stays[1].id


def test_two_things_are_taken_at_once() -> None:
    bench = Bench(seed=15)
    first, second = 500 * share(0.1, 0.1), 300 * share(0.35, 0.2)
    bench.change(first)
    bench.change(second)
    bench.change(200 * share(0.2, 0.25))
    events = bench.run(1.0, lambda s: -first * min(s / 0.3, 1) - second * np.clip((s - 0.25) / 0.3, 0, 1))
    bench.load = bench.load - first - second
    events += bench.run(4.0)
    stays = bench.estimator.stays()
    assert len(of(Vanished, events)) == 2
    assert [round(stay.weight_g, -2) for stay in stays] == [200]


def test_two_things_are_put_at_once() -> None:
    bench = Bench(seed=16, known={"A": KnownWeight(500, 10), "B": KnownWeight(300, 6)})
    first, second = 500 * share(0.1, 0.1), 300 * share(0.35, 0.2)
    bench.tags = frozenset({"A", "B"})
    events = bench.run(1.0, lambda s: first * min(s / 0.3, 1) + second * np.clip((s - 0.25) / 0.3, 0, 1))
    bench.load = bench.load + first + second
    events += bench.run(4.0)
    assert len(of(Appeared, events)) == 2
    places = {stay.tag: stay.xy for stay in bench.estimator.stays()}
    assert set(places) == {"A", "B"}
    if not of(LoadChanged, events):  # told apart
        assert np.hypot(places["A"][0] - 0.1, places["A"][1] - 0.1) < 0.05
        assert np.hypot(places["B"][0] - 0.35, places["B"][1] - 0.2) < 0.05


def test_a_load_too_heavy_for_its_tag_is_two_things() -> None:
    """The tag's thing weighs 300 g and 440 g have come: something without a tag is beside it, nobody knows where."""
    bench = Bench(seed=19, known={"A": KnownWeight(300, 4)})
    bench.change(900 * share(0.2, 0.2), rest=6.0)
    bench.tags = frozenset({"A"})
    first, second = 300 * share(0.1, 0.1), 140 * share(0.35, 0.2)
    events = bench.run(1.0, lambda s: first * min(s / 0.4, 1) + second * np.clip((s - 0.3) / 0.4, 0, 1))
    bench.load = bench.load + first + second
    events += bench.run(5.0)
    assert len(of(Appeared, events)) == 2 and not of(Vanished, events)
    (together,) = of(LoadChanged, events)
    new = {stay.id: stay for stay in bench.estimator.stays() if stay.id in together.stays}
    assert sorted((stay.tag or "", round(stay.weight_g, -1)) for stay in new.values()) == [("", 140), ("A", 300)]
    # What goes tells which it was, and where the other one stands.
    (vanished,) = of(Vanished, bench.change(-140 * share(0.35, 0.2), 0.3))
    assert new[vanished.stay].tag is None
    (stay,) = [stay for stay in bench.estimator.stays() if stay.tag == "A"]
    assert np.hypot(stay.xy[0] - 0.1, stay.xy[1] - 0.1) < 0.03


def test_a_part_of_a_thing_is_not_told_while_the_rest_of_it_is_on_its_way() -> None:
    bench = Bench(seed=20, known={"A": KnownWeight(500, 5), "B": KnownWeight(200, 3)})
    bench.tags = frozenset({"A", "B"})
    slow, quick = 500 * share(0.1, 0.1), 200 * share(0.35, 0.2)
    # A slow hand rests with 60 % of the weight on the board while somebody else puts a thing beside.
    bench.change(0.6 * slow + quick, 0.5, rest=1.0)
    bench.change(0.4 * slow, 0.5, rest=5.0)
    assert len(of(Appeared, bench.events)) == 2 and not of(Vanished, bench.events)
    assert {(one.tag, round(one.weight_g, -1)) for one in bench.estimator.stays()} == {("A", 500), ("B", 200)}


def test_a_slid_thing_keeps_its_stay_and_a_lifted_one_gets_a_new_one() -> None:
    bench = Bench(seed=17)
    bench.tags = frozenset({"T1"})
    start, goal = 600 * share(0.1, 0.1), 600 * share(0.3, 0.2)
    (appeared,) = of(Appeared, bench.change(start))
    events = bench.change(goal - start, 0.8, rest=4.0)
    moved = of(Moved, events)[-1]
    assert moved.stay == appeared.stay
    assert np.hypot(moved.xy[0] - 0.3, moved.xy[1] - 0.2) < 0.02
    lifted = bench.change(-goal, 0.3, rest=1.0)
    assert of(Vanished, lifted)[0].stay == appeared.stay
    back = bench.change(start, 0.3)
    (again,) = of(Appeared, back)
    (identified,) = of(Identified, back)
    assert again.stay != appeared.stay
    assert (identified.stay, identified.tag) == (again.stay, "T1")


def test_a_tag_without_a_weight_is_told_as_read_in_the_zone_once() -> None:
    bench = Bench(seed=18)
    bench.tags = frozenset({"T9"})
    assert bench.run(10.0) == [ZoneRead(of(ZoneRead, bench.events)[0].t, "shelf", "T9")]
    bench.tags = frozenset()
    (gone,) = bench.run(5.0)
    assert isinstance(gone, ZoneRead)
    assert gone.tag is None


def test_a_weight_without_a_tag_gets_a_stay() -> None:
    bench = Bench(seed=19)
    bench.change(250 * share(0.2, 0.1))
    (stay,) = bench.estimator.stays()
    assert stay.tag is None


@pytest.mark.parametrize("fault", ["nan", "zero", "stuck", "overload"])
def test_faults_of_cells_tell_nothing(fault: str) -> None:
    bench = Bench(seed=20)
    bench.change(700 * share(0.15, 0.15), rest=7.0)
    before = bench.estimator.stays()
    for i in range(300):
        grams = np.round((bench.load + bench.rng.normal(0, 8, 4)) / 5) * 5
        if fault == "zero":
            grams[:] = 0.0
        else:
            grams[1] = {"nan": np.nan, "stuck": 400.0, "overload": 1e9}[fault]
        assert bench.estimator.load(bench.t + 0.02 * i, grams) == []
    assert bench.estimator.unusable_cells == ((0, 1, 2, 3) if fault == "zero" else (1,))
    bench.t += 6.0
    assert bench.run(5.0) == []
    (stay,) = bench.estimator.stays()
    assert stay.id == before[0].id
    assert abs(stay.weight_g - 700) < 8
    assert bench.estimator.unusable_cells == ()
    (vanished,) = of(Vanished, bench.change(-700 * share(0.15, 0.15)))
    assert vanished.stay == before[0].id


@pytest.mark.parametrize("period_s", [0.05, 0.1, 0.15])
def test_a_stuck_cell_of_a_slow_board_tells_nothing(period_s: float) -> None:
    """Few samples tell late that a cell is stuck, and a load that does not move looks steady at once."""
    rng = np.random.default_rng(25)
    estimator = CabinetEstimator(GEOMETRY, zones=ZONES)
    for i in range(600):
        grams = 500 * share(0.1, 0.2) + rng.normal(0, 2, 4)
        if 300 <= i < 400:
            grams[1] = 777.0
        events = estimator.load(i * period_s, grams)
        assert events == [] or i < 300
    assert estimator.unusable_cells == ()


def test_vibration_and_radio_noise_tell_nothing() -> None:
    bench = Bench(seed=21)
    assert bench.run(20.0, lambda s: 20 * np.sin(2 * np.pi * 17.3 * s + np.arange(4)) * (s % 7 < 3)) == []
    bench.sd = 16.0
    assert bench.run(30.0) == []
    (appeared,) = of(Appeared, bench.change(100 * share(0.2, 0.2)))
    assert 10 < bench.estimator.noise_sd_g.mean() < 20
    assert abs(appeared.weight_g - 100) < 5 * appeared.weight_sd_g


def test_creep_moves_the_zero_and_no_thing() -> None:
    bench = Bench(seed=22)
    bench.change(1500 * share(0.2, 0.2), rest=6.0)
    creep = 0.03 * 1500 * share(0.2, 0.2)  # 3 % within three minutes: faster than any board
    assert bench.run(180.0, lambda s: creep * s / 180) == []
    (stay,) = bench.estimator.stays()
    assert abs(stay.weight_g - 1500) < 10
    assert 20 < bench.estimator.zero_g.sum() < 60


def test_errors_of_position_are_what_is_claimed() -> None:
    squares = []
    bench = Bench(seed=23)
    bench.run(5.0)
    for _ in range(40):
        x, y = bench.rng.uniform(0.1, 0.36), bench.rng.uniform(0.1, 0.22)
        thing = 150 * share(x, y)
        bench.tags = frozenset({"T1"})
        (appeared,) = of(Appeared, bench.change(thing, 0.1, rest=1.0))
        off = np.subtract(appeared.xy, (x, y))
        cov = np.array([[appeared.cov[0], appeared.cov[1]], [appeared.cov[1], appeared.cov[2]]])
        squares.append(float(off @ np.linalg.solve(cov, off)))
        bench.tags = frozenset()
        bench.change(-thing, 0.1, rest=3.0)
    assert 1.0 < np.mean(squares) < 3.5


def test_bad_input_is_told() -> None:
    estimator = CabinetEstimator(GEOMETRY, zones=ZONES)
    with pytest.raises(ValueError, match="3 values for 4 cells"):
        estimator.load(0.0, np.zeros(3))
    with pytest.raises(ValueError, match="no zone 'attic'"):
        estimator.inventory(0.0, "attic", frozenset())
    with pytest.raises(ValueError, match="format"):
        CabinetEstimator.from_dict({}, GEOMETRY, zones=ZONES)
    with pytest.raises(ValueError, match="not on one line"):
        Geometry(((0.0, 0.0), (0.1, 0.1), (0.2, 0.2)), 0.5, 0.5)
    with pytest.raises(ValueError, match="on the board"):
        Geometry(((0.0, 0.0), (0.6, 0.0), (0.2, 0.2)), 0.5, 0.5)


def test_a_zone_covers_its_polygon() -> None:
    zone = Zone("left", ((0.0, 0.0), (0.2, 0.0), (0.2, 0.3), (0.0, 0.3)))
    assert zone.covers((0.1, 0.1))
    assert not zone.covers((0.25, 0.1))
    assert zone.covers((0.25, 0.1), margin_m=0.06)
