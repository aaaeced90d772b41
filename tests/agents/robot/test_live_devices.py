"""Scans of devices as recordings have them, however the laser is mounted."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.devices.scans import Scan, Sweep
from tms_agents.robot.config import LiveSource
from tms_agents.robot.live_devices import recorded


def source(**more: object) -> LiveSource:
    return LiveSource.model_validate(
        {
            "laser": {"kind": "scip", "host": "laser"},
            "base": {"host": "robot"},
            "reader": {"kind": "llrp", "host": "reader", "round_s": 0.1},
            "antennas": [{"number": 1, "pose": [0.1, 0.0, 0.0]}],
        }
        | more
    )


@pytest.mark.parametrize("upside_down", [False, True])
@pytest.mark.parametrize("clockwise", [False, True])
def test_beams_keep_their_directions(upside_down: bool, clockwise: bool) -> None:
    angles = np.linspace(-2.0, 1.5, 8)
    if clockwise:
        angles = angles[::-1]
    ranges = 2.0 + np.arange(8.0) / 10
    sweep = Sweep(angles, 1e-4, 0.1, 0.1, 30.0)
    t, (count, first, step, longest), found, light = recorded(5.0, Scan(sweep, ranges), source(upside_down=upside_down))
    assert (t, count, longest, light) == (5.0, 8, 30.0, None) and step == pytest.approx(0.5)
    there = first + step * np.arange(count)
    wanted = -angles if upside_down else angles
    assert dict(zip(there.round(6), found, strict=True)) == dict(zip(wanted.round(6), ranges, strict=True))


def test_what_is_no_distance_is_none() -> None:
    sweep = Sweep(np.linspace(-1.0, 1.0, 6), 1e-4, 0.1, 0.1, 30.0)
    ranges = np.array([np.inf, np.nan, 0.05, 1.0, 8.0, 7.99])
    _, (_, _, _, longest), found, _ = recorded(0.0, Scan(sweep, ranges), source(range_max_m=8.0))
    assert longest == 8.0 and found.tolist() == [0.0, 0.0, 0.0, 1.0, 0.0, 7.99]


def test_ports_have_the_usual_numbers() -> None:
    found = source()
    assert found.base.place == "robot:8101"
