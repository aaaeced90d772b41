"""What is told and what is there agree: in every scan of simulated rooms, for every label."""

from __future__ import annotations

import itertools
import json
import math
from datetime import UTC, datetime

import pytest
from floor_listener import Listener

from tms_agents.floor import FloorEstimator, Sensor
from tms_agents.floor.labels import Labels
from tms_agents.floor.settings import Scene
from tms_agents.simulation.floor_world import LASERS, FloorWorld
from tms_schemas.observation import InventoryLabel, LabelMoved, MoverEntered, MoverLeft, Observation, Transfer

#: Rooms in which hypotheses differ in who is hidden, people turn up again, and two tracks turn out to be one.
ROOMS = [("eight", 1001, "legs"), ("bed", 1001, "prints"), ("robots", 1001, "prints"), ("three close", 2003, "prints")]


class Server:
    """Knows what an agent posts of movers, and nothing else; ``places`` by label."""

    def __init__(self) -> None:
        self.places: dict[str, tuple[float, float]] = {}

    def take(self, one: Observation) -> None:
        if isinstance(one, MoverEntered):
            self.places[one.label] = one.xy
        elif isinstance(one, LabelMoved):
            assert one.label in self.places
            self.places[one.label] = one.xy
        elif isinstance(one, MoverLeft):
            del self.places[one.label]
        elif isinstance(one, Transfer):
            del self.places[one.from_]

    def inventory(self, labels: list[InventoryLabel]) -> None:
        self.places = {one.label: one.xy for one in labels if one.kind == "mover" and one.xy is not None}


@pytest.mark.parametrize(("scene", "seed", "feet"), ROOMS)
def test_events_and_what_is_posted_tell_what_labels_there_are(scene: str, seed: int, feet: str) -> None:
    world = FloorWorld(scene, seed, feet=feet, laser=LASERS["coarse"])
    known, sensors = world.known(), {n: Sensor(one.laser.sweep(), one.reported) for n, one in world.sensors.items()}
    room = Scene(region=known.region, gates=known.gates, seats=known.seats, robots=known.robots)
    estimator, listener = FloorEstimator(sensors, scene=room), Listener()
    server, numbers, awaited = Server(), itertools.count(), 0
    labels = Labels(lambda: f"floor/{next(numbers)}", lambda t: datetime.fromtimestamp(t, UTC), tells_robots=True)
    for number, frame in enumerate(world.scans()):
        events = estimator.scan(frame.sensor, frame.t, frame.ranges)
        for event in events:
            listener.hear(event)
        for one in labels.observations(events):
            server.take(one)
        awaited += bool(estimator.awaited())
        there = estimator.labels() + estimator.awaited()
        listener.agrees(there)
        if number % 50 == 49:
            # As after a line was cut.
            server.inventory(labels.inventory(there, frame.t))
        movers = {labels.movers[one.id].label: one for one in there if one.kind == "mover"}
        assert server.places.keys() == movers.keys()
        for name, one in movers.items():
            # Told every 25 cm, or half a second; at rest a second later.
            gap = math.dist(server.places[name], one.xy)
            assert gap < 0.36 or one.seen_at < frame.t, (frame.t, one, server.places[name])
        if number % 301 == 300:
            # It goes on in the same way after a restart.
            saved = json.loads(json.dumps(estimator.to_dict()))
            estimator = FloorEstimator.from_dict(saved, sensors, scene=room)
    assert awaited
