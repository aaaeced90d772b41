"""Who has stood with whom may have handed him something: told when they stand there, and when they part."""

from __future__ import annotations

import itertools
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.floor import FloorEvent, Met, Moved, Vanished
from tms_agents.floor.movers.meetings import Meetings
from tms_agents.floor.state import BODY, CONCEALED, SEATED, empty

#: When the first two come together.
MET = 100.0


def people(*at: tuple[float, float], **fields: Any) -> Any:
    """Labels 7, 4 and 9; ``fields`` of the first one are so. Who is not placed is far away."""
    bodies = empty(BODY, 4)
    bodies["used"][:3] = bodies["confirmed"][:3] = 1
    bodies["label"][:3], bodies["x"][:3] = (7, 4, 9), (20.0, 40.0, 60.0)
    for n, (x, y) in enumerate(at):
        bodies["x"][n], bodies["y"][n] = x, y
    for name, value in fields.items():
        bodies[name][0] = value
    return bodies


def looked(meetings: Meetings, seconds: float, where: Any, since: float = MET, step: float = 0.1) -> list[Met]:
    """What is told while ``where`` gives the bodies of the time since then."""
    return [one for t in np.arange(0.0, seconds, step) for one in meetings.look(where(float(t)), since + float(t))]


def standing(t: float) -> Any:
    """Beside each other, swaying as people do."""
    return people((0.05 * np.sin(t), 0.0), (0.8, 0.05 * np.cos(2 * t)))


def parted(t: float) -> Any:
    return people((0.0, 0.0), (3.0, 0.0))


def test_it_is_told_as_soon_as_they_stand_there_for_when_they_came_to_and_once() -> None:
    meetings = Meetings(4)
    (one,) = looked(meetings, 8.0, standing)
    assert (one.label, one.other, one.since) == (4, 7, MET) and one.t == pytest.approx(MET + 2.0, abs=0.3)
    assert looked(meetings, 5.0, parted, MET + 8.0) == [], "they had no time to get anything else"
    (again,) = looked(meetings, 8.0, standing, MET + 20.0)
    assert again.since == MET + 20.0


def test_when_they_part_after_long_it_is_told_once_more_for_then() -> None:
    meetings = Meetings(4)
    assert len(looked(meetings, 3600.0, standing, step=0.2)) == 1, "not in between, however long"
    (end,) = looked(meetings, 60.0, parted, MET + 3600.0)
    assert (end.label, end.other) == (4, 7) and MET + 3599.0 < end.since < MET + 3600.0 <= end.t


@pytest.mark.parametrize(
    "where",
    [
        lambda t: people((-4.0 + t, 0.0), (4.0 - t, 0.5)),  # they pass each other
        lambda t: people((t, 0.0), (t, 0.6)),  # side by side
        lambda t: people((t, 0.0), (0.8 + t, 0.0)),  # one behind the other
        lambda t: people((0.0, 0.0), (-4.0 + 0.5 * t, 0.6)),  # slowly past somebody who stands
        lambda t: people((0.0, 0.0), (min(-4.0 + 2.0 * t, max(-0.6, t - 3.3)), 0.7)),  # a stop of a second
        lambda t: people((0.0, 0.0), (1.5, 0.0)),  # not within reach
        lambda t: people((0.0, 0.0), (0.8, 0.0), robot=1),  # robots tell it themselves
        lambda t: people((0.0, 0.0), (0.8, 0.0), confirmed=0),
        lambda t: people((0.0, 0.0), (0.8, 0.0), stale=CONCEALED),  # where he is nobody knows
    ],
)
def test_who_passes_or_is_not_there_has_handed_over_nothing(where: Any) -> None:
    assert looked(Meetings(4), 12.0, where) == []


def test_somebody_beside_a_bed() -> None:
    """Who sits is seen no more, but it is known where."""
    (one,) = looked(Meetings(4), 12.0, lambda t: people((0.0, 0.0), (0.8, 0.0), stale=SEATED))
    assert one.since == MET


def test_who_is_hidden_for_a_moment_has_not_parted() -> None:
    meetings = Meetings(4)
    assert len(looked(meetings, 3.0, standing)) == 1
    assert looked(meetings, 30.0, lambda t: people((0.0, 0.0), (0.8, 0.0), stale=CONCEALED), MET + 3.0) == []
    assert looked(meetings, 5.0, standing, MET + 33.0) == []
    (end,) = looked(meetings, 2.0, parted, MET + 38.0)
    assert MET + 37.0 < end.since < MET + 38.0


def test_three_who_stand_together_are_three_pairs() -> None:
    found = looked(Meetings(4), 5.0, lambda t: people((0.0, 0.0), (0.8, 0.0), (0.4, 0.7)))
    assert sorted((one.label, one.other) for one in found) == [(4, 7), (4, 9), (7, 9)]


def test_who_vanishes_has_parted() -> None:
    meetings = Meetings(4)
    looked(meetings, 20.0, standing)
    t = MET + 20.0
    (end,) = meetings.gone([Moved(t, 7, (0.0, 0.0), (0.01, 0.0, 0.01)), Vanished(t, 7, t - 1.0, t)], t)
    assert (end.label, end.other) == (4, 7) and end.since > t - 1.0
    assert meetings.save()["meetings"] == [] == looked(meetings, 5.0, parted, t)


def test_who_seemed_to_be_somebody_new_stands_there_still() -> None:
    """The label of the first one goes: he is 9, who was there before. It is the same meeting."""
    meetings = Meetings(4)
    looked(meetings, 5.0, standing)
    t = MET + 5.0

    def as_nine(_: float) -> Any:
        return people((20.0, 0.0), (0.8, 0.0), (0.0, 0.0), used=0)

    assert meetings.gone([Vanished(t, 7, t, t, into=9)], t) == []
    assert looked(meetings, 20.0, as_nine, t) == []
    (end,) = looked(meetings, 2.0, parted, t + 20.0)
    assert (end.label, end.other) == (4, 9)
    # Two labels of one body were no meeting.
    both = Meetings(4)
    looked(both, 20.0, standing)
    assert both.gone([Vanished(MET + 20.0, 7, MET + 20.0, MET + 20.0, into=4)], MET + 20.0) == []
    assert both.save()["meetings"] == []


@given(
    st.lists(
        st.tuples(*[st.sampled_from([0.0, 0.3, 0.6, 1.0, 1.6, 2.5])] * 3, st.sampled_from([0, CONCEALED, SEATED])),
        min_size=8,
        max_size=40,
    ),
    st.data(),
)
def test_it_goes_on_over_a_restart_and_is_told_at_a_bounded_rate(steps: list[Any], data: st.DataObject) -> None:
    cut = data.draw(st.integers(0, len(steps)))

    def played(meetings: Meetings, part: list[Any], first: int) -> list[FloorEvent]:
        return [
            one
            for n, (x, y, z, stale) in enumerate(part, first)
            for k in range(5)
            for one in meetings.look(people((0.0, 0.0), (x, y), (z, 0.5), stale=stale), MET + n + 0.2 * k)
        ]

    whole = played(Meetings(4), steps, 0)
    first, then = Meetings(4), Meetings(4)
    before = played(first, steps[:cut], 0)
    then.restore(json.loads(json.dumps(first.save())))
    assert before + played(then, steps[cut:], cut) == whole
    for pair in {(one.label, one.other) for one in whole}:  # type: ignore[union-attr]
        times = [one.since for one in whole if (one.label, one.other) == pair]  # type: ignore[union-attr]
        assert all(later - earlier >= 2.0 for earlier, later in itertools.pairwise(times))
