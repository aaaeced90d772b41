"""Two people met and may have been exchanged: what the room's belief makes of what is told of that."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from datetime import UTC, datetime

import pytest

from tms_agents.floor import Appeared, Confused, FloorEstimator, FloorEvent, Scene, Sensor
from tms_agents.floor.labels import Labels
from tms_agents.simulation.floor_world import LASERS, FloorWorld
from tms_schemas.observation import Observation
from tms_server.placement import DrawKey, Engine, LabelSpec, ObjectSpec, Parameters

COV = (0.01, 0.0, 0.01)


def belief(events: Sequence[Sequence[FloorEvent]]) -> dict[str, dict[str, float]]:
    """Where cup and plate are after what was told scan by scan; labels: 1 had the cup when they met, 2 the plate."""
    numbers = itertools.count(1)
    floor = Labels(lambda: f"floor/{next(numbers)}", lambda t: datetime.fromtimestamp(1e6 + t, UTC))
    entered = [Appeared(1.0, n, "mover", (float(n), 1.0), COV, since=1.0) for n in (1, 2)]
    told: list[Observation] = [one for scan in (entered, *events) for one in floor.observations(scan)]
    movers = [LabelSpec(id=f"floor/{n}", kind="mover", xy=(float(n), 1.0)) for n in (1, 2)]
    engine = Engine(
        [ObjectSpec(id="cup"), ObjectSpec(id="plate")],
        movers,
        {"type": "known", "placement": {"cup": "floor/1", "plate": "floor/2"}},
        Parameters.of({}),
        budget=None,
    )
    # The server folds what is late where it belongs.
    for n, one in enumerate(sorted(told[2:], key=lambda one: one.observed_at)):
        engine.apply(one, DrawKey(0, "floor", n))
    return engine.marginals()


def put(label: int, t: float) -> Appeared:
    """Who has this label has put something down."""
    return Appeared(t, 9, "object", (float(label), 1.0), COV, since=t, candidates=((label, 1.0),))


def test_what_they_hold_may_be_with_the_other_one() -> None:
    pies = belief([[Confused(30.0, 1, 2, 0.3, 20.0)]])
    assert pies["cup"] == pytest.approx({"floor/1": 0.7, "floor/2": 0.3})
    assert pies["plate"] == pytest.approx({"floor/2": 0.7, "floor/1": 0.3})


def test_what_was_put_down_before_it_was_told_may_be_the_others() -> None:
    pies = belief([[put(1, 22.0)], [Confused(30.0, 1, 2, 0.3, 20.0)]])
    assert pies["cup"] == pytest.approx({"floor/3": 0.7, "floor/2": 0.3})
    assert pies["plate"] == pytest.approx({"floor/2": 0.7, "floor/3": 0.3})


def test_when_labels_are_given_back_each_has_his_own_and_what_was_done_meanwhile_was_done_by_who_did_it() -> None:
    """Had they been exchanged, who was called 1 put down the plate. If not, giving back was wrong: 1 has the plate."""
    pies = belief([[put(1, 22.0)], [Confused(26.0, 1, 2, 0.8, 20.0), Confused(26.0, 1, 2, 1.0, 26.0)]])
    assert pies["cup"] == pytest.approx({"floor/1": 0.8, "floor/3": 0.2})
    assert pies["plate"] == pytest.approx({"floor/3": 0.8, "floor/1": 0.2})


def test_who_is_taken_for_another_one_in_a_room_is_told_and_has_his_label_back() -> None:
    """Three in shoes cross at close quarters before a coarse laser; two of them are exchanged for a second."""
    world = FloorWorld("three close", 2003, feet="prints", laser=LASERS["coarse"], duration=30.0)
    known = world.known()
    estimator = FloorEstimator(
        {name: Sensor(mount.laser.sweep(), mount.reported) for name, mount in world.sensors.items()},
        scene=Scene(region=known.region, gates=known.gates, seats=known.seats),
    )
    told: list[Confused] = []
    for frame in world.scans():
        told += [one for one in estimator.scan(frame.sensor, frame.t, frame.ranges) if isinstance(one, Confused)]
    back = {(one.t, one.label, one.other) for one in told if one.p == 1.0 and one.since == one.t}
    met = [one for one in told if one.since < one.t - 0.5 and (one.t, one.label, one.other) in back]
    assert any(one.p >= 0.5 for one in met)
    assert all(0.0 < one.p <= 1.0 and one.since <= one.t for one in told)
