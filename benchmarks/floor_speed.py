"""What floor sensing costs: CPU per scan of the whole estimator, beside Stone Soup's tracker alone.

Stone Soup is no dependency of ours: `pip install stonesoup` into the environment makes its rows appear.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from functools import partial
from typing import Any

import numpy as np
from floor_contestants import CONTESTANTS, Contestant
from numpy.typing import NDArray

from tms_agents.simulation.floor_world import FloorWorld, Frame

Floats = NDArray[np.float64]
#: Scans between two looks at the clock, which costs as much as a scan on some machines.
BATCH = 20
WARM_S = 45.0  # by then everybody and everything of the scene "crowd" is there


def speed(seed: int = 1000) -> None:
    """Eight people, two robots, twenty things, 1081 beams."""
    print('### CPU of one scan: 1081 beams, scene "crowd" (10 movers and 20 things, not all in sight)\n')
    print("| by | mean ms | median | p95 | labels |\n|---|---|---|---|---|")
    world = FloorWorld("crowd", seed, duration=105.0)
    frames = list(world.scans())
    truth = world.truth()
    for name in CONTESTANTS:
        contestant = _contestant(name, world)
        late = [frame for frame in frames if frame.t > WARM_S]
        _play(contestant, frames[: -len(late)])
        cost, labels = [], []
        for first in range(0, len(late) - BATCH + 1, BATCH):
            batch = late[first : first + BATCH]
            cost.append(_cpu_ms(partial(_play, contestant), batch))
            labels.append([(one["attr"], one["x"], one["y"]) for one in contestant.labels()])
        kinds = [np.mean([sum(attr == kind for attr, _, _ in now) for now in labels]) for kind in ("mover", "object")]
        _row(f"{name}, raw scans in, labels out", cost, f"{kinds[0]:.1f} movers, {kinds[1]:.1f} objects")
    if importlib.util.find_spec("stonesoup") is None:
        print("| Stone Soup GNN | skipped | `pip install stonesoup` | | |\n", flush=True)
        return
    for things in (False, True):
        points = _detections(truth, things)
        title = "movers and things" if things else "movers"
        count = f"{np.mean([len(one) for one in points]):.1f} detections"
        _row(f"Stone Soup GNN, tracking alone of {title}", stone_soup(points), count)
    print(flush=True)


def _row(title: str, cost_ms: Sequence[float], labels: str) -> None:
    median, high = np.percentile(cost_ms, [50, 95])
    print(f"| {title} | {np.mean(cost_ms):.3f} | {median:.3f} | {high:.3f} | {labels} |", flush=True)


def _contestant(name: str, world: FloorWorld) -> Contestant:
    sensors = {key: (mount.laser.sweep(), mount.reported) for key, mount in world.sensors.items()}
    return CONTESTANTS[name](sensors, world.known())


def _detections(truth: dict[str, Any], things: bool) -> list[Floats]:
    """Where they are, 3 cm astray, one in twenty missed, one false in each scan; of the same scans, (n, 2) each."""
    rng = np.random.default_rng(0)
    found = []
    for k, t in enumerate(truth["t"]):
        if t <= WARM_S:
            continue
        here = [(m["x"][k - m["frames"][0]], m["y"][k - m["frames"][0]]) for m in truth["movers"]
                if m["frames"][0] <= k < m["frames"][1]]  # fmt: skip
        if things:
            here += [(s["x"], s["y"]) for thing in truth["objects"] for s in thing["spans"] if s["t_placed"] <= t]
        points = np.array(here).reshape(-1, 2)
        points = points[rng.random(len(points)) < 0.95]
        points = points + rng.normal(0, 0.03, points.shape)
        found.append(np.vstack([points, rng.uniform(0, 5, (1, 2))]))
    return found


def stone_soup(scans: Sequence[Floats]) -> list[float]:
    """CPU ms of each scan for its global nearest neighbour tracker: constant velocity, started by three detections."""
    from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
    from stonesoup.deleter.time import UpdateTimeStepsDeleter
    from stonesoup.hypothesiser.distance import DistanceHypothesiser
    from stonesoup.initiator.simple import MultiMeasurementInitiator
    from stonesoup.measures import Mahalanobis
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import KalmanUpdater

    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.5), ConstantVelocity(0.5)])
    sight = LinearGaussian(ndim_state=4, mapping=(0, 2), noise_covar=np.diag([0.03**2, 0.03**2]))
    updater = KalmanUpdater(sight)
    associator = GNNWith2DAssignment(
        DistanceHypothesiser(KalmanPredictor(motion), updater, Mahalanobis(), missed_distance=4)
    )
    deleter = UpdateTimeStepsDeleter(10)
    start = datetime(2020, 1, 1)
    prior = GaussianState([[0], [0], [0], [0]], np.diag([0.0, 1.0, 0.0, 1.0]), timestamp=start)
    initiator = MultiMeasurementInitiator(prior, deleter, associator, updater, sight, 3)
    tracks: set[Any] = set()

    def track(batch: Sequence[tuple[datetime, set[Any]]]) -> None:
        nonlocal tracks
        for at, detections in batch:
            hypotheses = associator.associate(tracks, detections, at)
            used = set()
            for one in tracks:
                hypothesis = hypotheses[one]
                if hypothesis.measurement:
                    one.append(updater.update(hypothesis))
                    used.add(hypothesis.measurement)
                else:
                    one.append(hypothesis.prediction)
            tracks -= deleter.delete_tracks(tracks)
            tracks |= initiator.initiate(detections - used, at)

    times = [start + timedelta(seconds=0.1 * k) for k in range(len(scans))]
    timed = [
        (at, {Detection(point.reshape(2, 1), timestamp=at, measurement_model=sight) for point in points})
        for at, points in zip(times, scans, strict=True)
    ]
    return [_cpu_ms(track, timed[k : k + BATCH]) for k in range(0, len(timed) - BATCH + 1, BATCH)]


def _cpu_ms(work: Callable[[Any], None], batch: Sequence[Any]) -> float:
    """Of one scan of the batch."""
    begin = time.process_time_ns()
    work(batch)
    return (time.process_time_ns() - begin) / 1e6 / len(batch)


def _play(contestant: Contestant, frames: Sequence[Frame]) -> None:
    for frame in frames:
        contestant.scan(frame.sensor, frame.t, frame.ranges, frame.intensities)
