"""The estimator on recorded samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tms_agents.devices.scans import Sweep
from tms_agents.floor import Appeared, FloorEstimator, Sensor, Vanished


def sensor(data: np.lib.npyio.NpzFile) -> Sensor:
    """The sensor of a sample."""
    sweep = Sweep(
        data["angles"].astype(float),
        float(data["time_increment"]),
        1.0 / float(data["scan_rate"]),
        float(data["range_min"]),
        float(data["range_max"]),
    )
    x, y, heading = data["sensor_pose"].tolist()
    return Sensor(sweep, (x, y, heading))


@pytest.mark.realdata
def test_a_box_put_down_and_picked_up_is_one_label(shared_data: Path) -> None:
    data = np.load(shared_data / "floor/sim/s1_floor_A.npz")
    estimator = FloorEstimator({"A": sensor(data)})
    events = [
        event
        for t, ranges in zip(data["t"], data["ranges"], strict=True)
        for event in estimator.scan("A", float(t), ranges.astype(float))
    ]
    born = [event for event in events if isinstance(event, Appeared) and event.kind == "object"]
    assert len(born) == 1
    assert np.hypot(born[0].xy[0] - 2.465, born[0].xy[1] - 2.388) < 0.06
    gone = [event for event in events if isinstance(event, Vanished) and event.label == born[0].label]
    assert len(gone) == 1
    assert gone[0].earliest <= 41.6
    assert 41.5 <= gone[0].latest < 43.0
