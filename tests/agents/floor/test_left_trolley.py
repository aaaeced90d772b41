"""Who pushes furniture is one thing with it to the laser for a while; when he goes on, he is who he was before."""

from __future__ import annotations

from tms_agents.floor import FloorEstimator, Scene, Sensor
from tms_agents.simulation.floor_world import LASERS, FloorWorld


def test_who_goes_on_from_what_he_pushed_has_his_name_soon() -> None:
    """And keeps it: the trolley he left at 24 s is nobody, and does not take it back."""
    world = FloorWorld("furniture", 2003, feet="legs", laser=LASERS["coarse"])
    known = world.known()
    sensors = {name: Sensor(mount.laser.sweep(), mount.reported) for name, mount in world.sensors.items()}
    estimator = FloorEstimator(sensors, scene=Scene(region=known.region, gates=known.gates, seats=known.seats))
    told: list[tuple[float, list[int]]] = []
    for frame in world.scans():
        if frame.t > 45.0:
            break
        estimator.scan(frame.sensor, frame.t, frame.ranges)
        told.append((frame.t, [label.id for label in estimator.labels() if label.kind == "mover"]))
    assert all(ids == [1] for t, ids in told if 19.0 < t < 24.0)
    assert all(1 in ids for t, ids in told if t > 24.0)
    assert all(ids == [1] for t, ids in told if t > 40.0)
