"""What is told of movers, where the hypothesis that is the best now differs from the one before."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.floor.events import Appeared, Back, FloorEvent, Moved, Stale, Vanished
from tms_agents.floor.movers.told import Told
from tms_agents.floor.state import BODY, empty

COV = (0.01, 0.0, 0.01)
#: Of two movers: (x m, hidden) in each scan.
SCANS = st.lists(st.tuples(*[st.tuples(st.floats(0.0, 5.0), st.booleans())] * 2, st.booleans()), max_size=30)


def people() -> np.ndarray:
    bodies = empty(BODY, 4)
    bodies["used"][:2] = bodies["confirmed"][:2] = 1
    bodies["label"][:2] = 1, 2
    return bodies


def known() -> tuple[Told, np.ndarray]:
    """Two movers that have been told at (0, 0)."""
    told = Told(4)
    met: list[FloorEvent] = [Appeared(0.0, label, "mover", (0.0, 0.0), COV) for label in (1, 2)]
    assert told.agree(met, people(), 0.0) == met
    return told, people()


@given(SCANS)
def test_whoever_hears_the_events_knows_where_movers_are(scans: list) -> None:
    told, bodies = known()
    places, stale = {1: (0.0, 0.0), 2: (0.0, 0.0)}, set()
    for k, (*movers, exchanged) in enumerate(scans):
        t = 1.0 + k
        bodies["seen"][:2] = t
        for b, (x, hidden) in enumerate(movers):
            bodies["x"][b], bodies["stale"][b] = x, hidden
        bodies["label"][:2] = (2, 1) if exchanged else (1, 2)
        for event in told.agree([], bodies, t):
            if isinstance(event, Stale):
                assert event.label not in stale
                stale.add(event.label)
                continue
            assert isinstance(event, Back | Moved)
            assert isinstance(event, Back) == (event.label in stale and event.label not in hidden_of(bodies))
            stale.discard(event.label) if isinstance(event, Back) else None
            places[event.label] = event.xy
        assert stale == hidden_of(bodies)
        for body in bodies[:2]:
            assert math.dist(places[int(body["label"])], (body["x"], 0.0)) <= 0.1


def hidden_of(bodies: np.ndarray) -> set[int]:
    return set(bodies["label"][bodies["stale"] == 1].tolist())


@pytest.mark.parametrize("hidden", [False, True])
def test_what_is_known_is_not_told_again(hidden: bool) -> None:
    told, bodies = known()
    bodies["stale"][0] = hidden
    events: list[FloorEvent] = [Stale(1.0, 1)] if hidden else [Moved(1.0, 1, (0.0, 0.0), COV)]
    assert told.agree(events, bodies, 1.0) == events
    again: list[FloorEvent] = [Stale(2.0, 1)] if hidden else []
    assert told.agree(again, bodies, 2.0) == []
    (event,) = told.agree([Back(3.0, 2, (0.0, 0.0), COV)], bodies, 3.0)
    assert isinstance(event, Moved), "nobody has missed him"


def test_there_is_room_for_all_who_are_waited_for() -> None:
    told, bodies = known()
    for label in range(3, 60):
        told.agree([Appeared(0.0, label, "mover", (1.0, 1.0), COV), Stale(0.0, label)], bodies, 0.0)
    for label in range(3, 60):
        back: FloorEvent = Back(1.0, label, (2.0, 1.0), COV)
        assert told.agree([back, back], bodies, 1.0) == [back, Moved(1.0, label, (2.0, 1.0), COV)]
        left = Vanished(2.0, label, 0.0, 2.0)
        assert told.agree([left], bodies, 2.0) == [left]


def test_it_goes_on_after_a_restart() -> None:
    told, bodies = known()
    bodies["stale"][0] = 1
    told.agree([], bodies, 1.0)
    again = Told(4)
    again.restore(told.save())
    assert again.agree([], bodies, 2.0) == []
