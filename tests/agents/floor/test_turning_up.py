"""Who was lost in the middle of a room stands on what came to rest there, until it has proved to be a thing."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.association.association import Association
from tms_agents.floor.events import Back, Stale
from tms_agents.floor.movers.tracks import Tracks
from tms_agents.floor.scan.background import BACKGROUND
from tms_agents.floor.settings import FloorSettings, Scene
from tms_agents.floor.state import BODY, PRINT, empty

NOW = 100.0
ROOM = [(0.0, -4.0), (9.0, -4.0), (9.0, 4.0), (0.0, 4.0)]
DOOR = [(8.5, 1.0), (9.5, 1.0), (9.5, 2.0), (8.5, 2.0)]
#: A laser at the origin that looks along x and sees walls 8 m away.
OPEN = (np.full(101, 8.0), np.full(101, BACKGROUND, np.int8), np.full(101, 8.0), np.zeros(3), -0.5, 0.01)


@pytest.fixture
def prints() -> np.ndarray:
    """What came to rest at (4.4, 0) six seconds ago and is seen in part: it was nobody's."""
    prints = empty(PRINT, 4)
    values = {"used": 1, "x": 4.4, "first": NOW - 6.0, "rested": NOW - 6.0, "last": NOW, "width": 0.1}
    values |= {"hits": 60, "looks": 60, "whole": 40, "owner": -1, "whose": -1, "idle": 5.0}
    for name, value in values.items():
        prints[name][0] = value
    return prints


@pytest.fixture
def tracks() -> Tracks:
    """A room in which somebody was lost at (4, 0) ten seconds ago."""
    tracks = Tracks(Association(3, 4), FloorSettings(), Scene(region=ROOM, gates=[DOOR]))
    (lost,) = empty(BODY, 1)
    values = {"used": 1, "confirmed": 1, "label": 5, "x": 4.0, "seen": NOW - 10.0, "first": 20.0, "hits": 500}
    for name, value in (values | {"own": 7.0, "own_n": 200}).items():
        lost[name] = value
    assert tracks.absent.keep(lost)
    tracks._told.agree([Stale(NOW - 9.0, 5)], tracks.bodies, NOW - 9.0)
    assert [(one.id, one.xy, one.stale) for one in tracks.awaited(NOW)] == [(5, (4.0, 0.0), True)]
    return tracks


def look(tracks: Tracks, t: float) -> list:
    return tracks.review(t, 0.1, OPEN, lambda: 9, lambda body: False, lambda body: False, learned=True)


def later(tracks: Tracks, seconds: float, *, both: bool) -> tuple[list, float]:
    """What happens at last while the print is seen for so long, with another foot or without; and when."""
    for scan in range(1, round(10 * seconds) + 1):
        t = NOW + 0.1 * scan
        body = tracks.bodies[0]
        body["seen"] = body["a_seen"] = t
        body["hits"] += 1
        if both:
            body["b_seen"], body["by"] = t, 0.25
            body["both"] += 1
        if events := look(tracks, t):
            return events, t - NOW
    return [], seconds


def test_he_is_back_there_with_his_name(tracks: Tracks, prints: np.ndarray) -> None:
    (event,) = tracks.turns_up(prints, 0, NOW)
    assert isinstance(event, Back) and event.label == 5 and event.xy == pytest.approx((4.4, 0.0))
    (label,) = tracks.labels(NOW)
    assert (label.id, label.kind, label.since, label.stale) == (5, "mover", 20.0, False)
    assert tracks.bodies["own"][0] == 7.0
    assert prints["owner"][0] == 0
    assert tracks.absent.gone(1e6) == tracks.awaited(NOW) == []


def test_who_shows_no_other_foot_is_lost_again(tracks: Tracks, prints: np.ndarray) -> None:
    tracks.turns_up(prints, 0, NOW)
    events, after_s = later(tracks, 20.0, both=False)
    assert [(type(event), event.label) for event in events] == [(Stale, 5)]
    assert 5.0 < after_s < 9.0


def test_who_shows_both_stays(tracks: Tracks, prints: np.ndarray) -> None:
    tracks.turns_up(prints, 0, NOW)
    events, _ = later(tracks, 20.0, both=True)
    assert not any(isinstance(event, Stale) for event in events)
    assert [label.id for label in tracks.labels(NOW)] == [5]


def test_what_had_been_there_before_is_no_foot_of_his(tracks: Tracks, prints: np.ndarray) -> None:
    prints["rested"][0] = NOW - 20.0
    assert tracks.turns_up(prints, 0, NOW) == []
    assert tracks.labels(NOW) == []


def test_where_there_is_no_room_for_him_he_is_waited_for(tracks: Tracks, prints: np.ndarray) -> None:
    tracks.bodies["used"] = 1
    tracks.bodies["x"] = 8.0
    assert tracks.turns_up(prints, 0, NOW) == []
    assert [event.label for event in tracks.absent.gone(NOW + 60.0)] == [5]
