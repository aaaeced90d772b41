"""Two people stand together, and one may hand the other something: from scans to what the room believes."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np
import pytest
from floor_rig import OUTLINE, Room, sweep

from tms_agents.floor import (
    Appeared,
    FloorEstimator,
    FloorEvent,
    FloorLabel,
    FloorSettings,
    Met,
    Scene,
    Sensor,
    Vanished,
)
from tms_agents.floor.labels import Labels
from tms_agents.floor.story import told
from tms_schemas.observation import HandoverPossible, MoverLeft, Observation
from tms_server.placement import DrawKey, Engine, LabelSpec, ObjectSpec, Parameters

COV = (0.01, 0.0, 0.01)


def labels() -> Labels:
    numbers = itertools.count(1)
    return Labels(lambda: f"floor/{next(numbers)}", lambda t: datetime.fromtimestamp(1e6 + t, UTC))


def at(one: Observation) -> float:
    return one.observed_at.timestamp() - 1e6


def entered(*numbers: int, robot: bool = False) -> list[FloorEvent]:
    return [Appeared(1.0, n, "mover", (float(n), 1.0), COV, robot, since=1.0) for n in numbers]


def test_it_is_posted_for_when_they_stood_there_and_how_likely_it_is_the_room_knows() -> None:
    floor = labels()
    floor.observations(entered(1, 2))
    (one,) = floor.observations([Met(12.0, 1, 2, 10.0)])
    assert isinstance(one, HandoverPossible) and (one.a, one.b, one.p) == ("floor/1", "floor/2", None)
    assert at(one) == pytest.approx(10.0)
    # Of one who has left just now, too; never before what an inventory tells, nor of robots and of nobody.
    left, met = floor.observations([Vanished(31.0, 2, 30.9, 31.0), Met(31.0, 1, 2, 30.5)])
    assert isinstance(left, MoverLeft) and isinstance(met, HandoverPossible) and at(met) < at(left)
    floor.observations(entered(3))
    floor.inventory([FloorLabel(n, "mover", (1.0, 1.0), COV, 10.0, 32.0) for n in (1, 3)], 32.0)
    (late,) = floor.observations([Met(34.0, 1, 3, 20.0)])
    assert at(late) > 32.0
    floor.observations(entered(4, robot=True))
    assert floor.observations([Met(41.0, 3, 4, 40.0), Met(41.0, 3, 9, 40.0)]) == []


def test_people_who_look_are_told_too() -> None:
    assert told(Met(12.0, 1, 2, 10.0)) == "one of movers #1 and #2 may have handed the other something"


def belief(events: Sequence[FloorEvent], **parameters: object) -> dict[str, dict[str, float]]:
    """Where the cup is, that 1 had."""
    floor = labels()
    told = [one for event in (entered(1, 2), *([one] for one in events)) for one in floor.observations(event)][2:]
    movers = [LabelSpec(id=f"floor/{n}", kind="mover", xy=(float(n), 1.0)) for n in (1, 2)]
    start = {"type": "known", "placement": {"cup": "floor/1"}}
    engine = Engine([ObjectSpec(id="cup")], movers, start, Parameters.of(parameters), budget=None)
    # The server folds what is late where it belongs.
    for n, one in enumerate(sorted(told, key=lambda one: one.observed_at)):
        engine.apply(one, DrawKey(0, "floor", n))
    return engine.marginals()


def put(label: int, t: float) -> Appeared:
    """Who has this label has put something down."""
    return Appeared(t, 9, "object", (float(label), 1.0), COV, since=t, candidates=((label, 1.0),))


def test_the_other_one_may_have_it_as_likely_as_the_room_says() -> None:
    assert belief([Met(12.0, 1, 2, 10.0)])["cup"] == pytest.approx({"floor/1": 0.95, "floor/2": 0.05})
    assert belief([Met(12.0, 1, 2, 10.0)], p_handover=0.6)["cup"] == pytest.approx({"floor/1": 0.7, "floor/2": 0.3})
    assert belief([Met(12.0, 1, 2, 10.0)], use_handover=False)["cup"] == pytest.approx({"floor/1": 1.0})


def test_what_the_other_one_puts_down_then_is_what_he_was_handed() -> None:
    """Also where he did so before it was told that they stood together. Without it that had been impossible."""
    assert belief([put(2, 11.0), Met(12.0, 1, 2, 10.0)])["cup"] == pytest.approx({"floor/3": 1.0})
    assert "floor/3" not in belief([put(2, 11.0)])["cup"]


POSE, SWEEP = (2.5, 0.05, math.pi / 2), sweep()


def walked(room: Room, name: str, t: float, way: Sequence[tuple[float, float, float]]) -> None:
    """Where he is who is at (x, y) at those times; before and after he is not there."""
    times, xs, ys = (np.array(column) for column in zip(*way, strict=True))
    if not times[0] <= t <= times[-1]:
        return room.leave(name) if f"{name} left" in room.discs else None
    x, y = float(np.interp(t, times, xs)), float(np.interp(t, times, ys))
    before = [(float(np.interp(s, times, xs)), float(np.interp(s, times, ys))) for s in np.linspace(times[0], t, 200)]
    gone = sum(math.dist(one, other) for one, other in itertools.pairwise(before))
    far = np.interp(t + 0.3, times, xs) - x, np.interp(t + 0.3, times, ys) - y
    room.walk(name, x, y, math.atan2(far[1], far[0]) if any(far) else 0.0, gone)


Way = Sequence[tuple[float, float, float]]


def played(ways: dict[str, Way], seconds: float, restarts: bool = False) -> list[FloorEvent]:
    """What the estimator tells of a room in which people go these ways."""
    room, found = Room(), []
    sensors, scene, quick = {"laser": Sensor(SWEEP, POSE, 1.0)}, Scene(region=OUTLINE), FloorSettings(learn_s=2.0)
    estimator = FloorEstimator(sensors, quick, scene)
    for n in range(round(seconds * 10)):
        for name, way in ways.items():
            walked(room, name, n / 10, way)
        found += estimator.scan("laser", n / 10, room.ranges(SWEEP, POSE))
        if restarts and n % 20 == 0:
            saved = json.loads(json.dumps(estimator.to_dict()))
            estimator = FloorEstimator.from_dict(saved, sensors, quick, scene)
    return found


CARER = [(4.0, 0.3, 2.6), (7.0, 2.0, 2.4), (13.0, 2.1, 2.4), (16.5, 4.7, 2.6)]
OTHER = [(3.0, 4.7, 1.4), (6.0, 2.8, 2.2), (13.5, 2.75, 2.2), (17.0, 0.3, 1.4)]


@pytest.mark.parametrize("restarts", [False, True])
def test_two_who_stand_together_in_a_room(restarts: bool) -> None:
    found = played({"a": CARER, "b": OTHER}, 20.0, restarts)
    movers = [one.label for one in found if isinstance(one, Appeared) and one.kind == "mover"]
    (met,) = [one for one in found if isinstance(one, Met)]
    assert len(movers) == 2 and {met.label, met.other} == set(movers)
    assert 6.0 < met.since < 8.5 and met.t == pytest.approx(met.since + 2.0, abs=0.4)


def test_two_who_pass_each_other_in_a_room() -> None:
    a = [(4.0, 0.3, 2.4), (9.0, 4.7, 2.4)]
    b = [(4.0, 4.7, 1.8), (9.0, 0.3, 1.8)]
    found = played({"a": a, "b": b}, 14.0)
    assert sum(isinstance(one, Appeared) and one.kind == "mover" for one in found) >= 2
    assert [one for one in found if isinstance(one, Met)] == []
