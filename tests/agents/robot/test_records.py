"""Records of a drive: the clock that parks with the robot, and what the mapper gets of it."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.robot.records import Drive, Moved, Round, Scanned
from tms_agents.robot.replaying import record_of
from tms_agents.slam.polishing import PARKED_S, legs_of

LASER = np.array([0.1, 0.0, 0.0])


def scan(t: float) -> Scanned:
    return Scanned((t, (3, -0.5, 0.5, 8.0), np.array([1.0, 2.0, 0.0]), None))


def told(drive: Drive, begin: float, seconds: float, x: float, speed: float) -> float:
    """A robot that drives or stands for so long, with tags E1 and, where it drives, E2; where it is then."""
    for n in range(round(10 * seconds)):
        t = begin + 0.1 * n
        drive.take(Moved(t, (x + speed * 0.1 * n, 0.0, 0.0)))
        drive.take(scan(t + 0.01))
        drive.take(Round(t + 0.02, 0, frozenset(["E1", "E2"] if speed else ["E1"])))
    return x + speed * seconds


def test_what_comes_while_it_is_parked_is_left_out() -> None:
    drive = Drive(LASER, park_s=5.0)
    assert drive.snapshot() is None
    x = told(drive, 100.0, 20.0, 0.0, 0.5)
    assert drive.tags == drive.fresh == {"E1", "E2"} and not drive.parked and drive.legs == 1
    drive.fresh.clear()
    told(drive, 120.0, 60.0, x, 0.0)
    assert drive.parked and not drive.fresh
    before = drive.snapshot()
    assert before is not None and len(before.log) < 190
    told(drive, 180.0, 10.0, x, 0.5)
    assert not drive.parked and drive.legs == 2 and drive.fresh == {"E1", "E2"}  # read anew in this leg
    after = drive.snapshot()
    assert after is not None
    assert np.diff(after.log.t).max() >= PARKED_S and legs_of(after.log.t).max() == 1
    np.testing.assert_allclose(after.times[0], 100.01)
    assert 180.0 < after.times[-1] < 190.0  # the devices' own clock
    np.testing.assert_allclose(after.log.odometry[-1, 0], x + 0.5 * (after.times[-1] - 180.0), atol=0.006)


@given(
    st.lists(st.tuples(st.floats(0.5, 30.0), st.booleans()), min_size=1, max_size=8),
    st.floats(1.0, 10.0),
    st.floats(0.0, 2e9),
)
def test_its_clock_never_falls_and_jumps_where_it_parked(
    parts: list[tuple[float, bool]], park_s: float, begin: float
) -> None:
    drive, x, t = Drive(LASER, park_s), 0.0, begin
    for seconds, drives in parts:
        x = told(drive, t, seconds, x, 0.4 if drives else 0.0)
        t += round(10 * seconds) / 10
    found = drive.snapshot()
    assert found is not None
    assert (np.diff(found.log.t) > 0).all() and (np.diff(found.rounds.t) >= 0).all()
    assert (np.diff(found.times) > 0).all() and found.times[-1] <= t
    pauses = np.diff(np.sort(np.concatenate([found.log.t, found.rounds.t]))) >= PARKED_S
    assert pauses.sum() <= drive.legs - 1


def test_too_many_scans_are_not_taken() -> None:
    drive = Drive(LASER, park_s=5.0, most_scans=20)
    told(drive, 0.0, 30.0, 0.0, 0.5)
    found = drive.snapshot()
    assert drive.full and found is not None and len(found.log) == 20 and drive.left_out > 0


@given(st.text(max_size=60) | st.sampled_from(['{"type":"odom"}', '{"type":"scan","t":1}', '{"type":"rfid","t":"x"}']))
def test_what_is_no_record_is_none(line: str) -> None:
    assert record_of(line) is None


def test_records_of_recordings() -> None:
    assert record_of('{"type":"odom","t":1,"x":2,"y":3,"theta":4}') == Moved(1.0, (2.0, 3.0, 4.0))
    rfid = record_of('{"type":"rfid","t":1,"antenna":2,"tags":[{"id":"e2f0","rssi":-60}]}')
    assert rfid == Round(1.0, 2, frozenset(["E2F0"]))
    assert record_of('{"type":"odom","t":1,"x":2,"y":3,"theta":NaN}') is None
