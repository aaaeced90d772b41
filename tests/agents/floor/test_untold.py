"""Nothing of the room is told: where people come and go and how large robots are is learned."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence

import pytest
from floor_robots import LENGTH, OPEN, WIDTH, Way, robot
from floor_rooms import Circle, Room, Segment, box, together, walker

from tms_agents.floor import Appeared, FloorEstimator, Vanished
from tms_agents.floor.robots.sizes import weigh
from tms_agents.floor.warm import warm_up

#: Somebody behind it is not seen, nor anybody beside the door, on either side.
CUPBOARD = box(2.2, 2.6, 0.9, 0.3)
COMES: Way = [(9.0, 6.0, 2.0), (12.0, 4.0, 2.0), (15.0, 3.4, 3.4)]
HIDES: Way = [(18.0, 2.55, 3.5), (35.0, 2.5, 3.5)]
SHOWS: Way = [(38.0, 3.6, 3.2), (42.0, 3.6, 1.6)]
#: Past the door and out of sight.
GOES: Way = [(20.0, 3.6, 3.2), (25.0, 3.6, 1.6), (28.0, 4.6, 2.0), (30.0, 6.2, 2.0), (32.0, 6.2, 0.2)]
DRIVES: Way = [
    *((9.0, 6.0, 2.0), (14.0, 3.6, 2.0), (19.0, 2.6, 3.4), (24.0, 3.6, 2.6)),
    *((29.0, 3.6, 1.0), (34.0, 2.4, 1.0), (38.0, 2.4, 2.0), (60.0, 2.4, 2.0)),
]


def room(people: Sequence[Callable[[float], Sequence[Circle]]], *more: Callable[[float], Sequence[Segment]]) -> Room:
    return Room(
        together(*people),
        lambda t: (*OPEN, *(CUPBOARD if not more else ()), *(side for one in more for side in one(t))),
    )


def movers(events: Sequence[object]) -> list[Appeared]:
    return [event for event in events if isinstance(event, Appeared) and event.kind == "mover"]


def test_who_comes_out_from_behind_a_cupboard_is_still_he() -> None:
    first = walker([(7.0, 6.0, 2.0), (9.0, 4.0, 2.0), (11.0, 4.0, 2.2), (13.0, 6.6, 2.2)])
    one = walker([(at + 8.0, x, y) for at, x, y in (*COMES, *HIDES, *SHOWS)])
    _, events = room([first, one]).play(50.0)
    assert len(movers(events)) == 2


@pytest.mark.parametrize("pause", [6.0, 20.0])
def test_who_comes_in_where_somebody_went_out_is_somebody_new(pause: float) -> None:
    one = walker([*COMES, *GOES])
    begins = 32.0 + pause
    other = walker([(begins, 6.0, 2.0), (begins + 4.0, 3.6, 2.0), (begins + 8.0, 3.6, 1.4)])
    _, events = room([one, other]).play(begins + 8.0)
    assert len(movers(events)) == 2
    (left,) = (event for event in events if isinstance(event, Vanished))
    assert left.label == movers(events)[0].label
    assert left.t < 32.0 + 8.0


def test_a_robot_that_goes_by_itself_shows_how_large_it_is() -> None:
    """Then it is followed by its outline, and who steps beside it gets nothing of it."""
    names: set[int] = set()
    far: list[float] = []

    def look(t: float, estimator: FloorEstimator) -> None:
        robots = [label for label in estimator.labels() if label.robot]
        names.update(label.id for label in robots)
        if t > 39.0:
            (label,) = robots
            far.append(math.dist(label.xy, DRIVES[-1][1:]))

    passer = walker([(38.0, 5.5, 2.0), (42.0, 3.2, 1.8), (45.0, 1.9, 1.5), (55.0, 1.9, 1.5)])
    estimator, _ = room([passer], robot(DRIVES)).play(55.0, each=look)
    (size,) = estimator.to_dict()["footprints"]["learned"]["known"]
    assert size == pytest.approx((LENGTH / 2, WIDTH / 2), abs=0.03)
    assert len(names) == 1
    assert max(far) < 0.12


def test_what_learns_is_compiled_before_the_first_robot_comes() -> None:
    """Else the agent would stand still for seconds when one does."""
    warm_up()
    assert len(weigh.signatures) == 1
    room([], robot(DRIVES)).play(16.0)
    assert len(weigh.signatures) == 1


def test_what_is_seen_from_one_side_alone_is_of_no_known_size() -> None:
    straight: Way = [(9.0, 6.0, 2.0), (16.0, 1.6, 2.0), (60.0, 1.6, 2.0)]
    estimator, _ = room([], lambda t: robot(straight)(t)[:1]).play(25.0)
    assert estimator.to_dict()["footprints"]["learned"]["known"] == []


@pytest.mark.parametrize("restart", [170, 260])
def test_it_goes_on_after_a_restart_as_if_there_had_been_none(restart: int) -> None:
    here = room([walker([*COMES, *HIDES])], robot(DRIVES))
    straight, _ = here.play(32.0)
    estimator = FloorEstimator(here.sensors)
    for k, (name, t, ranges) in enumerate(here.scans(32.0)):
        if k == restart:
            estimator = FloorEstimator.from_dict(json.loads(json.dumps(estimator.to_dict())), here.sensors)
        estimator.scan(name, t, ranges)
    assert estimator.to_dict() == straight.to_dict()
