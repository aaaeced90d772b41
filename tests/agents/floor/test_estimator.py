"""The estimator in a small room: who walks, what lies there, what is hidden, what is moved."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from floor_rooms import WALLS, Room, box, sweep, thing, together, walker
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.floor import Appeared, FloorEstimator, FloorEvent, FloorSettings, Scene, Sensor, Vanished
from tms_agents.floor.scan.furniture import Furniture

#: Somebody comes in at the right, stops in the middle, goes back.
VISIT = [(9.0, 4.9, 2.0), (12.0, 2.2, 2.0), (14.0, 2.2, 2.0), (17.0, 4.9, 2.0)]


def born(events: list[FloorEvent], kind: str) -> list[Appeared]:
    return [event for event in events if isinstance(event, Appeared) and event.kind == kind]


def gone(events: list[FloorEvent], label: int) -> list[Vanished]:
    return [event for event in events if isinstance(event, Vanished) and event.label == label]


def test_somebody_who_walks_is_one_mover_where_he_is() -> None:
    way = [(9.0, 4.8, 1.0), (14.0, 1.0, 1.0), (19.0, 1.0, 3.0), (24.0, 4.5, 3.0)]
    errors: list[float] = []

    def check(t: float, estimator: FloorEstimator) -> None:
        if 11.0 < t < 23.5:
            (label,) = [label for label in estimator.labels() if label.kind == "mover"]
            x, y = (float(np.interp(t, [w[0] for w in way], [w[i] for w in way])) for i in (1, 2))
            errors.append(math.hypot(label.xy[0] - x, label.xy[1] - y))

    _, events = Room(walker(way)).play(24.0, each=check)
    assert len(born(events, "mover")) == 1
    assert not born(events, "object")
    assert np.median(errors) < 0.15


def test_a_thing_put_down_and_picked_up_is_told_with_who_and_when() -> None:
    first, second = walker(VISIT), walker([(t + 16.0, x, y) for t, x, y in VISIT])
    _, events = Room(together(first, second, thing(1.85, 1.9, 0.05, 13.0, 29.2))).play(36.0)
    (who, other) = born(events, "mover")
    (put,) = born(events, "object")
    assert math.hypot(put.xy[0] - 1.85, put.xy[1] - 1.9) < 0.02
    assert put.cov[0] < 0.02**2
    assert 12.9 < put.since < 13.5
    assert put.candidates[0][0] == who.label
    assert put.candidates[0][1] > 0.5
    (taken,) = gone(events, put.label)
    assert taken.earliest <= 29.3
    assert 29.2 <= taken.latest < 30.5
    assert taken.candidates[0][0] == other.label


def test_what_is_hidden_is_kept_and_found_again() -> None:
    hidden = box(0.9, 0.9, 0.5, 0.5)

    def segments(t: float) -> tuple[tuple[float, float, float, float], ...]:
        return (*WALLS, *hidden) if 20.0 < t < 60.0 else WALLS

    estimator, events = Room(together(walker(VISIT), thing(1.85, 1.9, 0.05, 13.0)), segments).play(70.0)
    (put,) = born(events, "object")
    assert not gone(events, put.label)
    assert [label.id for label in estimator.labels() if label.kind == "object"] == [put.label]


def test_a_thing_taken_while_hidden_goes_when_its_place_is_seen_with_the_whole_interval() -> None:
    hidden = box(0.9, 0.9, 0.5, 0.5)

    def segments(t: float) -> tuple[tuple[float, float, float, float], ...]:
        return (*WALLS, *hidden) if 20.0 < t < 40.0 else WALLS

    _, events = Room(together(walker(VISIT), thing(1.85, 1.9, 0.05, 13.0, 30.0)), segments).play(45.0)
    (put,) = born(events, "object")
    (taken,) = gone(events, put.label)
    assert 19.0 < taken.earliest < 20.3
    assert 40.0 < taken.latest < 41.2


def test_a_bin_that_is_moved_is_no_object() -> None:
    def segments(t: float) -> tuple[tuple[float, float, float, float], ...]:
        return (*WALLS, *box(*((3.0, 3.0) if t < 13.0 else (2.4, 2.6)), 0.3, 0.3))

    _, events = Room(walker(VISIT), segments).play(40.0)
    assert not born(events, "object")


def test_a_chair_that_is_moved_is_no_four_objects() -> None:
    def legs(t: float) -> list[tuple[float, float, float]]:
        x, y = (2.6, 2.4) if t < 13.0 else (2.1, 2.7)
        return [(x + dx, y + dy, 0.012) for dx in (-0.2, 0.2) for dy in (-0.2, 0.2)]

    _, events = Room(together(legs, walker(VISIT))).play(40.0)
    assert len(born(events, "object")) <= 1


def test_masks_seats_and_the_region_are_heeded() -> None:
    mask = [(1.6, 1.6), (2.1, 1.6), (2.1, 2.2), (1.6, 2.2)]
    _, events = Room(together(walker(VISIT), thing(1.85, 1.9, 0.05, 13.0))).play(25.0, scene=Scene(masks=[mask]))
    assert not born(events, "object")
    bed = [(0.5, 2.5), (1.8, 2.5), (1.8, 3.8), (0.5, 3.8)]
    sits = [(9.0, 4.9, 2.0), (13.0, 1.2, 2.4), (15.0, 1.2, 2.4)]
    stands_up = [(60.0, 1.3, 2.4), (62.0, 1.3, 2.4), (66.0, 4.0, 2.0)]
    scene = Scene(region=[(0, 0), (5, 0), (5, 4), (0, 4)], seats=[bed])
    room = Room(together(walker(sits), walker(stands_up)))
    estimator, events = room.play(50.0, scene=scene)
    (label,) = estimator.labels()
    assert label.stale
    estimator, more = room.play(65.0, estimator, start=50.0)
    assert [item.id for item in estimator.labels()] == [label.id]
    assert not estimator.labels()[0].stale
    assert len(born([*events, *more], "mover")) == 1


def test_who_crosses_a_mask_keeps_the_label() -> None:
    """Nobody is looked for in the lane of a robot, which people cross, too, and where they stand for a while."""
    lane = [(1.7, 0.5), (3.3, 0.5), (3.3, 3.5), (1.7, 3.5)]
    way = [(9.0, 4.9, 2.0), (11.0, 3.9, 2.0), (13.0, 2.5, 1.8), (20.0, 2.5, 1.8), (22.0, 1.0, 1.8), (26.0, 1.0, 2.4)]
    estimator, events = Room(walker(way)).play(25.0, scene=Scene(masks=[lane]))
    (who,) = born(events, "mover")
    assert [(one.id, one.stale) for one in estimator.labels()] == [(who.label, False)]
    # Who has gone in and does not come out is not there for ever.
    estimator, _ = Room(walker(way[:4])).play(90.0, scene=Scene(masks=[lane]))
    assert not estimator.labels()


def test_who_walks_on_behind_a_shelf_keeps_the_label() -> None:
    shelf = box(2.4, 1.6, 2.6, 0.3)
    way = [(8.0, -0.6, 3.2), (10.0, 0.4, 3.2), (12.5, 2.4, 3.3), (15.5, 4.5, 2.5), (17.0, 4.6, 1.4), (19.0, 4.5, 0.6)]
    gate = [(-0.3, 2.7), (0.3, 2.7), (0.3, 3.7), (-0.3, 3.7)]
    scene = Scene(region=[(0, 0), (5, 0), (5, 4), (0, 4)], gates=[gate])
    estimator, events = Room(walker(way), lambda t: WALLS + shelf).play(18.5, scene=scene)
    (who,) = born(events, "mover")
    assert [(one.id, one.stale) for one in estimator.labels()] == [(who.label, False)]
    assert math.dist(estimator.labels()[0].xy, (4.5, 0.7)) < 0.4


def test_two_who_cross_keep_their_labels() -> None:
    one = [(9.0, 4.8, 1.4), (15.0, 0.8, 1.4), (16.0, 0.8, 1.4)]
    two = [(9.0, 1.0, 3.6), (15.0, 3.6, 0.7), (16.0, 3.6, 0.7)]
    at: dict[float, dict[int, tuple[float, float]]] = {}

    def note(t: float, estimator: FloorEstimator) -> None:
        at[round(t, 1)] = {label.id: label.xy for label in estimator.labels()}

    Room(together(walker(one), walker(two))).play(16.0, each=note)
    before, after = at[11.0], at[15.0]
    assert len(before) == len(after) == 2
    right = max(before, key=lambda label: before[label][0])
    assert after[right][0] == min(xy[0] for xy in after.values())


def test_a_static_room_with_noise_tells_nothing() -> None:
    def legs(t: float) -> list[tuple[float, float, float]]:
        return [(2.6, 2.4, 0.012), (3.0, 2.4, 0.012), (1.5, 3.0, 0.03)]

    _, events = Room(legs, lambda t: (*WALLS, *box(3.5, 1.0, 0.6, 0.4)), noise_m=0.006).play(120.0)
    assert events == []


@settings(max_examples=6)
@given(
    x=st.floats(1.0, 3.5),
    y=st.floats(1.0, 3.0),
    radius=st.floats(0.03, 0.08),
    seed=st.integers(0, 99),
    cut=st.integers(90, 300),
)
def test_labels_are_never_used_again_and_a_restart_changes_nothing(
    x: float, y: float, radius: float, seed: int, cut: int
) -> None:
    lies = together(walker(VISIT), thing(x, y, radius, 13.0, 21.0), walker([(t + 14.0, *xy) for t, *xy in VISIT]))
    room = Room(lies, seed=seed)
    scans = list(room.scans(32.0))
    straight, restarted = FloorEstimator(room.sensors), FloorEstimator(room.sensors)
    labels: list[int] = []
    for k, (name, t, ranges) in enumerate(scans):
        if k == cut:
            state = json.loads(json.dumps(restarted.to_dict()))
            restarted = FloorEstimator.from_dict(state, room.sensors)
        events = straight.scan(name, t, ranges)
        assert events == restarted.scan(name, t, ranges)
        labels += [event.label for event in events if isinstance(event, Appeared)]
        ids = [label.id for label in straight.labels()]
        assert len(set(ids)) == len(ids)
    assert straight.labels() == restarted.labels()
    assert len(set(labels)) == len(labels)


def test_two_sensors_see_one_thing_once_whichever_tells_first() -> None:
    pair = {
        "A": Sensor(sweep(), (0.05, 0.05, math.pi / 4)),
        "B": Sensor(sweep(), (4.95, 3.95, -3 * math.pi / 4)),
    }
    seen = []
    for names in (["A", "B"], ["B", "A"]):
        room = Room(together(walker(VISIT), thing(1.85, 1.9, 0.05, 13.0)), sensors={name: pair[name] for name in names})
        estimator, _ = room.play(30.0)
        (label,) = [label for label in estimator.labels() if label.kind == "object"]
        assert math.hypot(label.xy[0] - 1.85, label.xy[1] - 1.9) < 0.03
        seen.append(label.xy)
    assert math.dist(*seen) < 0.02


def test_legs_of_moved_furniture_outlive_a_restart_and_a_state_without_them_is_damaged() -> None:
    room = Room()
    state = json.loads(json.dumps(room.play(3.0)[0].to_dict() | {"legs": [(1.0, 2.0, 3.0)]}))
    assert FloorEstimator.from_dict(state, room.sensors).to_dict()["legs"] == [(1.0, 2.0, 3.0)]
    del state["legs"]
    with pytest.raises(ValueError, match="damaged"):
        FloorEstimator.from_dict(state, room.sensors)


def test_what_was_saved_stays_as_it_was() -> None:
    furniture = Furniture()
    furniture.legs.append((1.0, 2.0, 3.0))
    saved = furniture.save()
    furniture.legs.append((4.0, 5.0, 6.0))
    assert saved["legs"] == [(1.0, 2.0, 3.0)]


def test_wrong_input_is_refused_and_loses_nothing() -> None:
    room = Room()
    estimator, _ = room.play(3.0)
    with pytest.raises(ValueError, match="no floor sensor"):
        estimator.scan("Z", 4.0, np.zeros(541))
    with pytest.raises(ValueError, match="541 ranges"):
        estimator.scan("A", 4.0, np.zeros(5))
    with pytest.raises(ValueError, match="back in time"):
        estimator.scan("A", 1.0, np.ones(541))
    estimator.scan("A", 4.0, np.full(541, np.nan))
    with pytest.raises(ValueError, match="format"):
        FloorEstimator.from_dict({"format": 99}, room.sensors)
    state = estimator.to_dict()
    with pytest.raises(ValueError, match="other sensors"):
        FloorEstimator.from_dict(state, {"B": room.sensors["A"]})
    with pytest.raises(ValueError, match="sensor or version"):
        FloorEstimator.from_dict(state, {"A": Sensor(sweep(100), (0, 0, 0))})
    del state["things"]
    with pytest.raises(ValueError, match="damaged"):
        FloorEstimator.from_dict(state, room.sensors)
    with pytest.raises(ValueError, match="positive"):
        FloorSettings(free_s=-1)
    with pytest.raises(ValueError, match="corners"):
        Scene(region=[(0, 0), (1, 1)])
