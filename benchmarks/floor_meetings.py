"""Who is told to have stood with whom (`Met`), against who did, in simulated rooms with truth.

    python benchmarks/floor_meetings.py --seeds 2101-2104 --scenes "three,eight"      (make bench-meetings)

Two stand while they are within 1.2 m of each other and neither strays 0.4 m; they meet until they are 2 m apart. It is
told of those who seem to stand for two seconds. What nobody can tell to a moment is left out on both sides: who is told
is wrong if these two did not stand for one second then (or nobody is there), who is not told is missed if they stood
for three.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from itertools import combinations
from typing import Any, NamedTuple

from tms_agents.floor import FloorEstimator, Met, Scene, Sensor
from tms_agents.simulation.floor_world import LASERS, FloorWorld

_REACH_M, _STRAYS_M, _PARTED_M = 1.2, 0.4, 2.0
_LEAST_S, _MISSED_S = 1.0, 3.0
#: A label is of who is so near; what is told is of a time so near, and late by so much at most.
_OFF_M, _NEAR_S, _LATE_S = 0.6, 0.5, 3.0
Xy = tuple[float, float]


class Told(NamedTuple):
    """What was told at ``t``, since when, and where the two labels were."""

    t: float
    since: float
    at: tuple[Xy, Xy]


class Stand(NamedTuple):
    """Two people who stood together from one time to the other, in their nth meeting."""

    pair: tuple[str, str]
    begin: float
    end: float
    meeting: int


def played(world: FloorWorld) -> tuple[list[Told], list[float]]:
    """What is told, and the times of the first laser's scans."""
    known = world.known()
    estimator = FloorEstimator(
        {name: Sensor(mount.laser.sweep(), mount.reported) for name, mount in world.sensors.items()},
        scene=Scene(region=known.region, gates=known.gates, seats=known.seats),
    )
    found, times, first = [], [], next(iter(world.sensors))
    nowhere = (math.inf, math.inf)
    for frame in world.scans():
        if frame.sensor == first:
            times.append(frame.t)
        for event in estimator.scan(frame.sensor, frame.t, frame.ranges, frame.intensities):
            if isinstance(event, Met):
                there = {one.id: one.xy for one in estimator.labels()}
                at = there.get(event.label, nowhere), there.get(event.other, nowhere)
                found.append(Told(event.t, event.since, at))
    return found, times


def people(truth: dict[str, Any], times: list[float]) -> dict[str, dict[float, Xy]]:
    """Where each was when."""
    return {
        one["id"]: dict(zip(times[one["frames"][0] :], zip(one["x"], one["y"], strict=True), strict=False))
        for one in truth["movers"]
        if one["kind"] == "person"
    }


def stands(there: dict[str, dict[float, Xy]]) -> Iterator[Stand]:
    """Of each pair."""
    for pair in combinations(sorted(there), 2):
        one, other = (there[name] for name in pair)
        begun: tuple[float, Xy, Xy] | None = None
        last, meeting = 0.0, 0
        for t in sorted(one.keys() & other.keys()):
            a, b = one[t], other[t]
            apart = math.dist(a, b)
            strays = begun is not None and max(math.dist(a, begun[1]), math.dist(b, begun[2])) > _STRAYS_M
            if begun is not None and (apart > _REACH_M or strays):
                yield Stand(pair, begun[0], last, meeting)
                begun = None
            if begun is None and apart <= _REACH_M:
                begun = t, a, b
            last, meeting = t, meeting + (apart > _PARTED_M)
        if begun is not None:
            yield Stand(pair, begun[0], last, meeting)


def who(told: Told, there: dict[str, dict[float, Xy]]) -> tuple[str, ...]:
    """The two people at the labels; less than two where nobody is there."""
    found = set()
    for at in told.at:
        off = {name: math.dist(at, way[min(way, key=lambda t: abs(t - told.t))]) for name, way in there.items() if way}
        found |= {name for name, away in off.items() if away == min(off.values()) and away < _OFF_M}
    return tuple(sorted(found))


def judged(told: list[Told], there: dict[str, dict[float, Xy]]) -> tuple[int, int, int]:
    """How many of what is told are wrong; how many meetings there were, and how many of them are missed."""
    stood = list(stands(there))
    pairs = [who(one, there) for one in told]
    wrong = sum(
        not any(
            stand.pair == pair
            and stand.end - stand.begin >= _LEAST_S
            and stand.begin < one.t + _NEAR_S
            and stand.end > one.since - _NEAR_S
            for stand in stood
        )
        for one, pair in zip(told, pairs, strict=True)
    )
    long = {(one.pair, one.meeting) for one in stood if one.end - one.begin >= _MISSED_S}
    missed = 0
    for pair, meeting in long:
        during = [one for one in stood if (one.pair, one.meeting) == (pair, meeting)]
        begin, end = min(one.begin for one in during), max(one.end for one in during) + _LATE_S
        missed += not any(begin <= one.t <= end for one, of in zip(told, pairs, strict=True) if of == pair)
    return wrong, len(long), missed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default="three,eight,standing,bed,things")
    parser.add_argument("--seeds", default="2120-2122", help="FIRST-LAST")
    parser.add_argument("--laser", default="fine", choices=sorted(LASERS))
    parser.add_argument("--feet", default="legs", choices=["legs", "prints"])
    parser.add_argument("--seconds", type=float, default=90.0)
    arguments = parser.parse_args()
    first, last = map(int, arguments.seeds.split("-"))
    print("scene      rooms  told  wrong  meetings  missed", flush=True)
    for scene in arguments.scenes.split(","):
        sums = [0, 0, 0, 0]
        for seed in range(first, last + 1):
            laser = LASERS[arguments.laser]
            world = FloorWorld(scene, seed, feet=arguments.feet, laser=laser, duration=arguments.seconds)
            told, times = played(world)
            found = (len(told), *judged(told, people(world.truth(), times)))
            sums = [one + other for one, other in zip(sums, found, strict=True)]
        print(f"{scene:10} {last - first + 1:5} {sums[0]:5} {sums[1]:6} {sums[2]:9} {sums[3]:7}", flush=True)


if __name__ == "__main__":
    main()
