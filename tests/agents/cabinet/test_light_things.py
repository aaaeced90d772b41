"""Things of 30 to 60 g, hardly more than the noise: moved slowly, and beside others of their weight."""

from __future__ import annotations

import numpy as np
import pytest
from cabinet_bench import Bench, of, share

from tms_agents.cabinet import KnownWeight, Vanished


def placed(bench: Bench) -> dict[str | None, tuple[float, float]]:
    return {stay.tag: stay.xy for stay in bench.estimator.stays()}


def near(one: tuple[float, float], x: float, y: float, metres: float) -> bool:
    return float(np.hypot(one[0] - x, one[1] - y)) < metres


def test_a_light_thing_that_is_carried_over_the_board_has_moved() -> None:
    """Its tag stays in view in the hand, and the antenna's field doubles the noise."""
    right = 0
    for seed in range(8):
        bench = Bench(seed=seed, known={"A": KnownWeight(36, 1), "B": KnownWeight(250, 3)})
        bench.tags = frozenset({"B"})
        bench.change(250 * share(0.3, 0.1))
        bench.tags = frozenset({"A", "B"})
        bench.change(36 * share(0.1, 0.2), rest=6.0)
        bench.sd = 16.0
        bench.run(4.0)
        bench.change(-36 * share(0.1, 0.2), 4.0, rest=0.5)
        bench.change(36 * share(0.25, 0.25), 1.0, rest=8.0)
        places = placed(bench)
        right += places.keys() == {"A", "B"} and near(places["A"], 0.25, 0.25, 0.08)
    assert right >= 7


@pytest.mark.parametrize("seed", range(4))
def test_of_two_alike_the_one_goes_whose_tag_is_missed(seed: int) -> None:
    bench = Bench(seed=seed, known={"A": KnownWeight(62, 1), "B": KnownWeight(55, 1)})
    first, second = 62 * share(0.31, 0.22), 55 * share(0.36, 0.18)
    bench.tags = frozenset({"A"})
    bench.change(first, rest=5.0)
    bench.tags = frozenset({"A", "B"})
    bench.change(second, rest=5.0)
    stays = {stay.tag: stay.id for stay in bench.estimator.stays()}
    bench.tags = frozenset({"B"})
    gone = of(Vanished, bench.change(-first, 0.2, rest=5.0))
    assert [one.stay for one in gone] == [stays["A"]]


def test_a_light_thing_is_not_taken_by_half() -> None:
    """A hand rests on the thing beside it for a while: what is missing is less than the tag says."""
    bench = Bench(seed=3, known={"A": KnownWeight(60, 1)})
    bench.tags = frozenset({"A"})
    bench.change(60 * share(0.12, 0.05), rest=6.0)
    events = bench.run(4.0, lambda s: -22 * share(0.43, 0.08))
    assert not of(Vanished, events)
    assert placed(bench).keys() == {"A"}
