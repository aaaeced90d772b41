"""A level that goes on through restless moments, and loads that are nothing of what has been brought."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.cabinet import KnownWeight
from tms_agents.cabinet.fusion import Explanation, Kind
from tms_agents.cabinet.plateau import Plateau, fits_none
from tms_agents.cabinet.steps import Step


def step(settled: float, grams: float, *, before: float = 0.0) -> Step:
    nothing = np.zeros((0, 4))
    return Step(
        onset=settled - 1.0,
        settled=settled,
        now=settled + 0.5,
        change=np.full(4, grams / 4),
        variance=np.full(4, 4.0),
        before=np.full(4, before),
        before_variance=np.full(4, 1.0),
        path=nothing,
        path_variance=nothing,
        restless=1.0,
    )


def test_a_level_is_as_old_as_its_first_step() -> None:
    plateau = Plateau()
    assert [plateau.since(step(t, grams)) for t, grams in ((10.0, 400), (11.5, 404), (13.0, 397))] == [10.0] * 3
    assert plateau.since(step(14.0, 460)) == 14.0
    assert plateau.since(step(15.0, 460, before=300.0)) == 15.0


@pytest.mark.parametrize(
    ("kind", "grams", "expected"),
    [
        ("put", (300,), False),
        ("put", (200,), False),
        ("put", (250,), True),
        ("put", (500,), True),
        ("two", (300, 200), False),
        ("two", (300, 140), True),
        ("two", (298, 302), True),
        ("take", (250,), False),
    ],
)
def test_what_fits_none_of_the_things_that_were_brought(kind: Kind, grams: tuple[float, ...], expected: bool) -> None:
    loads = [np.full(4, one / 4) for one in grams]
    found = Explanation(kind, 1.0, load=loads[0], second=loads[1] if len(loads) > 1 else None)
    brought = {"A": KnownWeight(300, 3), "B": KnownWeight(200, 3)}
    assert fits_none(found, step(1.0, sum(grams)), brought) is expected
    assert not fits_none(found, step(1.0, sum(grams)), {}), "nothing was brought"
    assert not fits_none(found, step(1.0, sum(grams)), brought | {"C": None}), "a thing of unknown weight was brought"


def test_of_two_things_one_may_have_no_tag() -> None:
    both = Explanation("two", 1.0, load=np.full(4, 75.0), second=np.full(4, 30.0))
    assert not fits_none(both, step(1.0, 420), {"A": KnownWeight(300, 3)})
    assert fits_none(both, step(1.0, 420), {"A": KnownWeight(200, 3)})
