"""A whole floor without I/O, in made-up time: several lasers, mounting, restarts, what cannot be used."""

from __future__ import annotations

import itertools
import json
import logging
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from floor_rig import (
    COMES,
    DEPTH,
    DOORS,
    GONE,
    OUTLINE,
    PUT_AT,
    QUICK,
    STOPS,
    WIDTH,
    Room,
    config_toml,
    laser_toml,
    story,
    sweep,
)

from tms_agents.clocks import Clocks
from tms_agents.config import read_config
from tms_agents.devices.scans import Scan
from tms_agents.devices.transport import DeviceState
from tms_agents.floor.config import FloorConfig, SceneSection
from tms_agents.floor.core import Floor
from tms_agents.floor.live_view import LiveView
from tms_schemas.observation import Inventory, LabelAppeared, LabelMoved, LabelVanished, MoverEntered, MoverLeft

SOUTH, WEST = (2.5, 0.05, math.pi / 2), (0.05, 2.4, 0.0)
SWEEP = sweep()


class Bench:
    """Lasers in a ``Room`` feed a ``Floor``; time passes with ``run``."""

    def __init__(self, folder: Path, poses, saved=None, start: float = 1000.0, **laser: str) -> None:
        text = "".join(
            laser_toml(f'{{ kind = "scip", host = "{name}" }}', pose, name, laser.get(name, ""))
            for name, pose in poses.items()
        )
        path = folder / "floor.toml"
        path.write_text(config_toml("lab", "http://127.0.0.1:1", text, more=QUICK + DOORS))
        self.now, self.poses, self.room = start, poses, Room()
        #: How far the computer's clock was set.
        self.set_s = 0.0
        self.clocks = Clocks.resumed(saved or {}, lambda: self.now + self.set_s, lambda: self.now)
        numbers = itertools.count(50 if saved else 1)
        config = read_config(path, FloorConfig)
        self.floor = Floor(config, {}, self.clocks, lambda: f"lab-floor/{next(numbers)}", saved)
        self.sweeps = dict.fromkeys(poses, SWEEP)
        for name in poses:
            self.floor.line(name, DeviceState("connected", "test"))

    def run(self, seconds: float, play=lambda t: None, only: str | None = None, scan=None):
        found, start = [], self.now
        for _ in range(round(seconds / 0.1)):
            self.now += 0.1
            play(self.now - start)
            for name, pose in self.poses.items():
                if only in (None, name):
                    made = scan(name) if scan else self.room.scan(self.sweeps[name], pose, self.now - 0.04)
                    found += self.floor.scans(name, self.now, [made])
        return found


def kinds(observations):
    return [type(one) for one in observations if not isinstance(one, LabelMoved)]


def kinds_of(kind, observations):
    return [one for one in observations if isinstance(one, kind)]


def test_two_lasers_see_one_walker_and_one_thing(tmp_path):
    bench = Bench(tmp_path, {"south": SOUTH, "west": WEST})
    assert bench.run(COMES) == []
    found = bench.run(GONE - COMES + 5.0, lambda t: story(bench.room, t + COMES))
    assert kinds(found) == [MoverEntered, LabelAppeared, MoverLeft]
    (thing,) = [one for one in found if isinstance(one, LabelAppeared)]
    assert math.dist(thing.xy, PUT_AT) < 0.03
    assert bench.floor.inventory().labels[0].label == thing.label
    assert [one.state for one in bench.floor.states().values()] == ["connected", "connected"]
    assert any("appeared" in text for _, text in bench.floor.story)


def test_a_laser_that_does_not_come_is_not_waited_for_and_comes_later(tmp_path):
    bench = Bench(tmp_path, {"south": SOUTH, "west": WEST})
    bench.run(4.0, only="south")
    assert bench.floor.estimator is None
    bench.run(4.0, only="south")
    bench.room.put("thing", *PUT_AT)
    (appeared,) = bench.run(5.0, only="south")
    assert isinstance(appeared, LabelAppeared)
    found = bench.run(4.0)  # both: the floor is learnt anew, and that is told
    assert isinstance(found[0], Inventory) and found[0].labels == []
    assert kinds(found[1:]) == [], "what lay there is background for the new one"


def test_the_live_picture_shows_walls_where_they_are_though_the_laser_errs(tmp_path):
    bench = Bench(tmp_path, {"south": SOUTH}, south="range_scale = 0.96")
    view = LiveView(bench.floor, bench.clocks, lambda: bench.now)

    def scan(name):
        made = bench.room.scan(SWEEP, SOUTH, bench.now - 0.04)
        return replace(made, ranges=made.ranges / 0.96)

    def look(t):
        view.now()
        view.refresh()

    bench.run(4.0, look, scan=scan)
    walls = np.array(view.now()["lasers"][0]["walls"])
    assert len(walls) > 300
    off = np.minimum.reduce([abs(walls[:, 0]), abs(walls[:, 0] - WIDTH), abs(walls[:, 1] - DEPTH), abs(walls[:, 1])])
    assert np.median(off) < 0.02 and off.max() < 0.05


@pytest.mark.parametrize(("error", "too_long"), [(0.0, ""), (0.006, " and measures +0.6 % too long")])
def test_it_is_said_once_that_a_laser_stands_or_measures_otherwise_than_is_given(tmp_path, caplog, error, too_long):
    caplog.set_level(logging.INFO)
    bench = Bench(tmp_path, {"south": SOUTH})
    bench.room = Room(noise_m=0.001)
    told = bench.floor.config.model_copy(update={"scene": SceneSection(region=[*OUTLINE])})
    x, y, theta = SOUTH
    floor = Floor(told, {"south": (x + 0.03, y + 0.02, theta - 0.01)}, bench.clocks, lambda: "lab-floor/1")
    for _ in range(60):
        bench.now += 0.1
        scan = bench.room.scan(SWEEP, SOUTH, bench.now - 0.04)
        floor.scans("south", bench.now, [replace(scan, ranges=scan.ranges * (1 + error))])
    (line,) = [record.getMessage() for record in caplog.records if "as the room tells" in record.getMessage()]
    assert line.startswith("laser south: as the room tells, it stands at x = ")
    numbers = [float(number) for number in re.findall(r"= (-?[0-9.]+)", line)]
    assert numbers == pytest.approx(SOUTH, abs=0.01)
    assert line.partition(f"theta = {numbers[2]:.4f}")[2] == too_long


def test_upside_down(tmp_path):
    bench = Bench(tmp_path, {"south": SOUTH}, south="upside_down = true")

    def scan(name):
        seen = bench.room.scan(SWEEP, SOUTH, bench.now - 0.04)
        return replace(seen, ranges=seen.ranges[::-1])  # it sweeps the other way

    bench.run(4.0, scan=scan)
    bench.room.put("thing", *PUT_AT)
    (appeared,) = bench.run(4.0, scan=scan)
    assert math.dist(appeared.xy, PUT_AT) < 0.03


def test_somebody_of_whom_nothing_is_seen_any_more_is_in_every_inventory_until_the_leaving_is_told(tmp_path):
    """As after a line was cut, and after a restart: who must be somewhere in the room has not left."""
    bench = Bench(tmp_path, {"south": SOUTH})
    bench.run(COMES)
    (entered,) = kinds_of(MoverEntered, bench.run(STOPS - COMES, lambda t: story(bench.room, t + COMES)))
    bench.run(1.5)
    bench.room.leave("walker")  # in the middle of the room
    assert kinds(bench.run(5.0)) == []
    state = json.loads(json.dumps(bench.floor.to_dict()))
    for floor in (bench, Bench(tmp_path, {"south": SOUTH}, state, bench.now + 1.0)):
        (told,) = floor.floor.inventory().labels
        assert (told.label, told.kind) == (entered.label, "mover")
        assert [one.stale for one in floor.floor.seen()] == [True]
        (left,) = kinds_of(MoverLeft, floor.run(70.0))
        assert left.label == entered.label
        assert floor.floor.inventory().labels == []


@pytest.fixture
def saved(tmp_path):
    bench = Bench(tmp_path, {"south": SOUTH})
    bench.run(4.0)
    bench.room.put("thing", *PUT_AT)
    (appeared,) = bench.run(4.0)
    return json.loads(json.dumps(bench.floor.to_dict())), appeared.label, bench.now


def test_a_restart_goes_on_where_it_was(tmp_path, saved):
    state, label, now = saved
    again = Bench(tmp_path, {"south": SOUTH}, state, now + 60.0)
    assert [one.label for one in again.floor.inventory().labels] == [label]
    again.room.put("thing", *PUT_AT)
    assert again.run(3.0) == [], "nothing has changed"
    again.room.take("thing")
    (gone,) = again.run(3.0)
    assert isinstance(gone, LabelVanished) and gone.label == label


def test_a_clock_that_is_set_back_while_things_lie_there(tmp_path):
    """What is taken after that is not told to have been taken before it was put."""
    bench = Bench(tmp_path, {"south": SOUTH})
    bench.run(COMES)
    found = bench.run(GONE - COMES + 0.5, lambda t: story(bench.room, t + COMES))
    bench.set_s = -3600.0
    found.append(bench.floor.inventory())
    bench.room.take("thing")
    found += bench.run(4.0)
    assert kinds(found) == [MoverEntered, LabelAppeared, Inventory, MoverLeft, LabelVanished]
    times = [one.observed_at for one in found if not isinstance(one, LabelMoved)]
    assert times == sorted(times) and times[-1] == times[2], "told for the last time before that"


def test_a_clock_that_went_back_over_a_restart(tmp_path, saved):
    state, label, now = saved
    again = Bench(tmp_path, {"south": SOUTH}, state, now - 500.0)
    again.room.put("thing", *PUT_AT)
    assert again.run(3.0) == []
    assert [one.label for one in again.floor.inventory().labels] == [label]


@pytest.mark.parametrize("change", ["pose", "lasers", "damaged", "format", "labels"])
def test_a_state_that_does_not_fit_is_said_and_left_out(tmp_path, saved, caplog, change):
    state, _, now = saved
    poses = {"south": SOUTH}
    if change == "pose":
        poses = {"south": (2.6, 0.05, math.pi / 2)}
    elif change == "lasers":
        poses = {"north": SOUTH}
    elif change == "damaged":
        state["estimator"]["things"]["data"] = "AAAA"
    elif change == "format":
        state["estimator"]["format"] = 99
    else:
        state["labels"] = {"things": {"x": []}}
    with caplog.at_level(logging.WARNING):
        again = Bench(tmp_path, poses, state, now + 60.0)
    assert "does not fit, starting anew" in caplog.text
    assert again.floor.inventory().labels == []
    again.run(4.0)
    again.room.put("thing", *PUT_AT)
    (appeared,) = again.run(4.0)
    assert int(appeared.label.partition("/")[2]) >= 50


@pytest.mark.parametrize(
    ("ranges", "says"),
    [
        (np.full(361, 0.03), "100% of the beams end at its window"),
        (np.full(361, np.nan), "100% of the beams are errors"),
        (np.full(361, 3.0), "it repeats one scan"),
    ],
)
def test_what_says_nothing_of_the_room_is_a_fault_and_makes_nothing_up(tmp_path, ranges, says):
    bench = Bench(tmp_path, {"south": SOUTH})
    bench.run(4.0)
    (state,) = bench.floor.states().values()
    assert state.state == "connected"
    found = bench.run(4.0, scan=lambda name: Scan(SWEEP, ranges.copy(), None, bench.now - 0.04))
    (state,) = bench.floor.states().values()
    assert state.state == "faulty" and state.why.startswith("south: ") and says in state.why
    if "repeats" not in says:  # a wall that comes nearer at once is something, a moment long
        assert found == []
    found = bench.run(3.0)
    (state,) = bench.floor.states().values()
    assert state.state == "connected" and kinds(found) == []
