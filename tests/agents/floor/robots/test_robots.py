"""Robots whose size nobody told: what is wide, goes by itself and takes no steps, whatever it looked like from afar."""

from __future__ import annotations

import pytest

from tms_agents.floor.robots.recognizing import recognize
from tms_agents.floor.state import BODY, empty


def looks_like_a_robot(**fields: float) -> bool:
    """Whether what has gone 2 m and is half a metre wide by now is taken for a robot; ``fields`` as in `BODY`."""
    bodies = empty(BODY, 1)
    known = {"used": 1, "confirmed": 1, "hits": 60, "wide": 0.8, "far": 0.5, "x0": 2.0, "walked_x": 2.0, "x": 4.0}
    for name, value in (known | fields).items():
        bodies[name] = value
    found = recognize(bodies, 0.3, 0.9)
    assert found == bodies["machine"][0] == bodies["robot"][0]
    return bool(found)


def test_what_always_was_one_wide_thing_is_a_robot() -> None:
    assert looks_like_a_robot(both=2)


@pytest.mark.parametrize("steps", [0, 1])
def test_what_fell_apart_from_afar_and_took_no_steps_is_one_too(steps: int) -> None:
    assert looks_like_a_robot(both=20, own_stance_n=steps)


@pytest.mark.parametrize(
    "fields",
    [
        {"own_stance_n": 4},  # it has walked: somebody who stands beside a cabinet
        {"pushed": 0.3},  # somebody went beside it
        {"from_furniture": 1},
        {"x": 2.5},  # it has not gone far
        {"far": 1.2},
    ],
)
def test_what_may_be_a_person_or_be_pushed_is_none(fields: dict[str, float]) -> None:
    assert not looks_like_a_robot(both=20, **fields)
