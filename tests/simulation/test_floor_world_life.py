"""The life in the simulated room: gait, distances, what each scenario promises; and the room without a script."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from tms_agents.simulation.floor_world import FINE, LASERS, FloorWorld, LiveRoom, Mount, Robot, Thing, Wall
from tms_agents.simulation.floor_world.gait import Build, Walker
from tms_agents.simulation.floor_world.plan import Door, Plan, Ways
from tms_agents.simulation.floor_world.room import Furniture
from tms_agents.simulation.floor_world.shapes import Drawing
from tms_agents.simulation.floor_world.stories import new_thing


@cache
def truth_of(name: str, seed: int, duration: float | None = None) -> tuple[FloorWorld, dict[str, Any]]:
    world = FloorWorld(name, seed, duration=duration)
    for _ in world.scans():
        pass
    return world, world.truth()


# gait


def walked(body: Callable[[float], tuple[float, float]], seconds: float) -> list[tuple[float, list[Any], Any]]:
    """(t, [((x, y), velocity) of each foot], what the plane of a sole meets) every 10 ms."""
    rng = np.random.default_rng(4)
    walker = Walker(body(0.0), 0.0, 0.0, rng, Build.draw(rng))
    found = []
    for t in np.arange(0.01, seconds, 0.01):
        walker.step(float(t), body(float(t)))
        drawing = Drawing()
        walker.draw(drawing, 0, float(t), "prints")
        found.append((float(t), [foot.position(float(t)) for foot in walker._feet], drawing.shapes()))
    return found


def test_shoes_stand_for_half_a_second_and_more_a_stride_apart_and_the_swinging_one_is_not_seen() -> None:
    steps = walked(lambda t: (1.1 * t, 0.0), 12.0)
    for side in (0, 1):
        stands = np.array([feet[side][1] == (0.0, 0.0) for _, feet, _ in steps])
        x = np.array([feet[side][0][0] for _, feet, _ in steps])
        prints = np.unique(np.round(x[stands], 3))[2:-1]
        assert np.all((np.diff(prints) > 0.9) & (np.diff(prints) < 1.5))
        changes = np.flatnonzero(np.diff(stands.astype(int)))[2:-1]
        times = np.diff(changes) * 0.01
        long, short = times[::2], times[1::2]
        stances = long if stands[changes[0] + 1] else short
        assert np.all((stances >= 0.45) & (stances <= 0.95))
    visible = [len(np.unique(shapes.circles[:, 1] > 0)) if len(shapes.circles) else 0 for _, _, shapes in steps]
    assert {1, 2} == set(visible[100:])  # one shoe swings while the other stands


def test_feet_stay_under_the_body_on_turns_and_come_together_where_it_stops() -> None:
    def body(t: float) -> tuple[float, float]:
        t = min(t, 9.0)
        return (2 * math.cos(t / 2), 2 * math.sin(t / 2))

    steps = walked(body, 12.0)
    off = [math.dist(np.mean([xy for xy, _ in feet], axis=0), body(t)) for t, feet, _ in steps]
    assert np.percentile(off, 95) < 0.35
    assert max(off[-100:]) < 0.1


def test_who_stands_still_takes_small_steps_now_and_then() -> None:
    steps = walked(lambda t: (0.0, 0.0), 60.0)
    moved = [any(velocity != (0.0, 0.0) for _, velocity in feet) for _, feet, _ in steps]
    assert 0 < np.mean(moved) < 0.3
    assert all(math.hypot(*xy) < 0.35 for _, feet, _ in steps for xy, _ in feet)


# ways


def test_a_way_leads_round_furniture_and_there_is_none_into_a_closed_corner() -> None:
    plan = Plan(width=5.0, depth=4.0, niche=(0.0, 0.0), doors=(Door(wall="e", y=2.0),))
    barrier = Furniture(id="shelf", kind="box", width=3.0, depth=0.3, pose=(2.5, 2.0, 0.0))
    path = Ways(plan, [barrier], [], 0.25).path((2.5, 1.0), (2.5, 3.0))
    assert path is not None and len(path) >= 3
    corners = [np.array(xy) for xy in [(2.5, 1.0), *path]]
    points = [a + u * (b - a) for a, b in pairwise(corners) for u in np.linspace(0, 1, 50)]
    assert min(barrier.distance((float(x), float(y))) for x, y in points) > 0.15
    closed = Furniture(id="shelf", kind="box", width=5.2, depth=0.3, pose=(2.5, 2.6, 0.0))
    assert Ways(plan, [closed], [], 0.25).path((2.5, 1.0), (2.5, 3.5)) is None


# scenarios


def test_three_walkers_pass_each_other_within_half_a_metre_and_nobody_walks_through_anybody() -> None:
    _, truth = truth_of("three", 1)
    tracks = {m["id"]: (m["frames"][0], np.array([m["x"], m["y"]]).T) for m in truth["movers"]}
    gaps = []
    for a, (ka, xa) in tracks.items():
        for b, (kb, xb) in tracks.items():
            first, last = max(ka, kb), min(ka + len(xa), kb + len(xb))
            if a < b and last > first:
                gaps.append(np.linalg.norm(xa[first - ka : last - ka] - xb[first - kb : last - kb], axis=1))
    assert min(gap.min() for gap in gaps) > 0.2
    assert sum(np.count_nonzero((gap[1:] < 0.5) & (gap[:-1] >= 0.5)) for gap in gaps) >= 4


def test_things_of_all_sizes_come_and_go_and_are_seen() -> None:
    _, truth = truth_of("things", 1)
    assert {thing["size"] for thing in truth["objects"]} == {0.03, 0.05, 0.08, 0.15}
    spans = [span for thing in truth["objects"] for span in thing["spans"]]
    assert sum(span["t_picked"] is not None for span in spans) >= 3
    for span in spans:
        assert span["first_visible"] is None or span["first_visible"] >= span["t_placed"]
        assert span["t_picked"] is None or span["t_picked"] > span["t_placed"]
        assert span["first_clear"] is None or span["first_clear"] >= span["t_picked"] + 0.3
        walker = next(m for m in truth["movers"] if m["id"] == span["placed_by"])
        k = round(10 * span["t_placed"]) - walker["frames"][0]
        near = min(math.dist((walker["x"][i], walker["y"][i]), (span["x"], span["y"])) for i in range(k - 5, k + 5))
        assert near < 0.6


@pytest.mark.parametrize(
    ("name", "seed"), [("things", 1416), ("near wall", 1406), ("robots", 1418), ("hidden", 1413), ("start", 1400)]
)
def test_nobody_acts_from_afar_or_vanishes_in_the_room_though_others_are_in_his_way(name: str, seed: int) -> None:
    world = FloorWorld(name, seed)
    life = world.life
    while life.now < world.duration:
        there = {one.id: one.xy for one in life.movers.values()}
        lying = dict(life.room.things)
        life.advance(life.now + 0.1)
        for stay in life.stays:
            for at, who in ((stay.placed_at, stay.placed_by), (stay.picked_at, stay.picked_by)):
                if who is not None and at is not None and life.now - 0.1 < at <= life.now:
                    assert math.dist(there[who], stay.thing.pose[:2]) < 0.85
        for thing in life.room.things.keys() - lying.keys():
            new = life.room.things[thing]
            gaps = [math.dist(new.pose[:2], one.pose[:2]) - 0.5 * (new.size + one.size) for one in lying.values()]
            assert min(gaps, default=1.0) > 0.0
        assert not any(life.plan.contains(there[gone], -0.01) for gone in there.keys() - life.movers.keys())


@pytest.mark.parametrize(("name", "seed"), [("robots", 1469), ("hidden", 1304)])
def test_nobody_stands_on_what_lies_there(name: str, seed: int) -> None:
    world = FloorWorld(name, seed)
    life = world.life
    while life.now < world.duration:
        life.advance(life.now + 0.1)
        for mover in life.movers.values():
            for thing in life.room.things.values():
                on_it = math.dist(mover.xy, thing.pose[:2]) < 0.5 * thing.size + 0.05
                assert mover.walker is None or mover.walker.lifted or not on_it


def test_who_meets_a_robot_in_the_door_lets_it_pass() -> None:
    world = FloorWorld("robots", 2194, laser=LASERS["coarse"])
    inside = set()
    while world.life.now < world.duration:
        world.life.advance(world.life.now + 0.5)
        inside |= {one.id for one in world.life.movers.values() if world.life.plan.contains(one.xy, 0.5)}
    assert inside == {"p1", "p2", "r1", "r2"}


def test_things_are_hidden_for_longer_than_a_minute_and_one_is_taken_meanwhile() -> None:
    _, truth = truth_of("hidden", 1)
    spans = [span for thing in truth["objects"] for span in thing["spans"]]
    assert max(end - begin for span in spans for begin, end in span["occluded"]) > 60
    taken = [span for span in spans if span["t_picked"]]
    assert any(span["first_clear"] is None or span["first_clear"] > span["t_picked"] + 3 for span in taken)


def test_what_finds_no_place_at_a_wall_lies_on_the_open_floor(monkeypatch: pytest.MonkeyPatch) -> None:
    life = FloorWorld("near wall", 1501).life
    monkeypatch.setattr("tms_agents.simulation.floor_world.stories._by_the_wall", lambda life, size: None)
    thing = new_thing(life, 0.08, "o1", where="wall")
    assert life.plan.contains(thing.pose[:2], 0.3)


def test_things_near_a_wall_are_less_than_10_cm_before_it() -> None:
    world, truth = truth_of("near wall", 1, 130.0)
    plan = world.life.plan
    gaps = []
    for thing in truth["objects"]:
        x, y = thing["spans"][0]["x"], thing["spans"][0]["y"]
        gaps.append(min(x, y, plan.width - x, plan.depth - y) - thing["size"] / 2)
    assert sum(gap < 0.1 for gap in gaps) >= 5


@pytest.mark.parametrize("seed", [1, 2])
def test_visitors_stay_for_seconds_and_no_two_things_have_one_name(seed: int) -> None:
    world, truth = truth_of("visits", seed)
    stays = [m["t_leave"] - m["t_enter"] for m in truth["movers"] if m["kind"] == "person" and m["t_leave"]]
    assert len(stays) >= 5
    assert 5.0 < float(np.median(stays)) < 30.0
    names = [stay.thing.id for stay in world.life.stays]
    assert len(names) == len(set(names)) > 0


def test_who_sits_on_the_bed_is_in_the_room_but_no_beam_meets_him() -> None:
    _, truth = truth_of("bed", 1, 130.0)
    sitter = truth["movers"][0]
    k0, k1 = sitter["frames"]
    unseen = np.array(sitter["hits"]["A"][k0:k1]) == 0
    longest = max(len(run) for run in "".join("x" if one else " " for one in unseen).split())
    assert longest > 200


def test_people_and_the_truth_about_them_are_there_from_the_first_scan() -> None:
    _, truth = truth_of("start", 1, 15.0)
    assert [mover["frames"][0] for mover in truth["movers"]] == [0, 0]
    assert truth["t_background_end"] == 0.0


def test_furniture_moves_and_the_door_swings_on_its_hinge() -> None:
    _, truth = truth_of("furniture", 1)
    moved = {piece["id"]: piece for piece in truth["furniture"] if len(piece["poses"]) > 1}
    assert {"chair", "door"} <= set(moved) and len(moved) >= 4
    door = moved["door"]
    hinges = [
        (x - door["w"] / 2 * math.cos(theta), y - door["w"] / 2 * math.sin(theta))
        for x, y, theta in (pose["pose"] for pose in door["poses"])
    ]
    assert max(math.dist(hinges[0], hinge) for hinge in hinges) < 1e-6
    assert sum(event["type"] == "furniture" for event in truth["events"]) >= 6


def test_two_lasers_see_different_parts_and_the_second_is_not_quite_where_it_is_said_to_be() -> None:
    world, truth = truth_of("two lasers", 1)
    hits = [np.array(mover["hits"][name][:1000]) for mover in truth["movers"] for name in ("A", "B")]
    only = [((a > 0) & (b == 0)).sum() for a, b in zip(hits[::2], hits[1::2], strict=True)]
    assert max(only) > 50
    assert world.sensors["A"].pose == world.sensors["A"].reported
    off = math.dist(world.sensors["B"].pose[:2], world.sensors["B"].reported[:2])
    assert off == pytest.approx(0.012)


def test_both_kinds_of_feet_walk_in_the_same_room() -> None:
    legs, prints = (FloorWorld("three", 9, feet=feet, duration=60.0) for feet in ("legs", "prints"))
    assert legs.room.furniture == prints.room.furniture
    assert legs.sensors["A"].pose == prints.sensors["A"].pose
    counts = []
    for world in (legs, prints):
        seen = [scan for scan in world.scans() if scan.t > 15]
        truth = world.truth()
        counts.append(np.mean([np.mean(np.array(m["hits"]["A"][150:]) > 0) for m in truth["movers"]]))
        assert len(seen) > 400
    assert counts[0] > counts[1] > 0.4  # shoes are seen less of the time


# the room without a script


def live(feet: Any = "prints") -> LiveRoom:
    walls = [Wall((0, 0), (6, 0)), Wall((6, 0), (6, 5)), Wall((6, 5), (0, 5)), Wall((0, 5), (0, 0))]
    mount = Mount(name="A", laser=FINE, pose=(3.0, 0.05, math.pi / 2), reported=(3.0, 0.05, math.pi / 2))
    return LiveRoom(walls, [], [mount], np.random.default_rng(1), feet)


def points(ranges: Any) -> Any:
    angles = math.pi / 2 + FINE.sweep().angles
    good = np.isfinite(ranges)
    return np.stack([3.0 + (ranges * np.cos(angles))[good], 0.05 + (ranges * np.sin(angles))[good]], axis=1)


def test_a_room_without_a_script_shows_people_things_and_robots_where_they_are_told_to_be() -> None:
    room = live("legs")
    room.things["cup"] = Thing(id="cup", size=0.1, shape="disc", pose=(1.5, 2.0, 0.0))
    room.robots["r"] = Robot(id="r", length=0.5, width=0.4, pose=(4.5, 3.0, 0.3))
    for k in range(60):
        room.move_people(0.05 * k, {"ann": (2.0 + 0.04 * k, 3.5)})
    ranges, intensities = room.scan("A", 2.95)
    assert ranges.shape == intensities.shape == (FINE.beams,)
    seen = points(ranges)
    for place, reach in (((1.5, 2.0), 0.06), ((4.5, 3.0), 0.33), ((4.36, 3.5), 0.8)):
        assert np.count_nonzero(np.hypot(*(seen - place).T) < reach) >= 3
    room.move_people(3.0, {})
    del room.things["cup"], room.robots["r"]
    empty = points(room.scan("A", 3.0)[0])
    inside = (np.abs(empty - [3.0, 2.5]) < [2.8, 2.3]).all(axis=1)
    assert np.count_nonzero(inside) <= 12  # isolated errors only
