"""Has the estimator compiled before the first scan needs it: a few made-up scans with somebody who drops something."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import numpy as np

from tms_agents.compiled import version
from tms_agents.devices.scans import Sweep
from tms_agents.floor import FloorEstimator, FloorSettings, Sensor
from tms_agents.floor.feet.clutter import costs
from tms_agents.floor.feet.prints import follow
from tms_agents.floor.robots.sizes import weigh
from tms_agents.floor.scan.dark import dark_width
from tms_agents.floor.scan.freespace import look

_BEAMS, _HZ = 128, 20


def compiled_before() -> bool:
    """Whether numba has kept what it compiled of this source, wherever it keeps it."""
    return all(map(_kept, (look, costs, follow)))


def _kept(kernel: Any) -> bool:
    source = Path(inspect.getfile(kernel.py_func)).resolve()
    name = f"{source.stem}.{kernel.py_func.__name__}-*-{version(source)}.*.nbi"
    return any(Path(kernel.stats.cache_path).glob(name))


def warm_up() -> None:
    """Takes a quarter of a second, or, the first time on a computer, a minute or two."""
    angles = np.linspace(-1.2, 1.2, _BEAMS)
    sweep = Sweep(angles, 0.0, 1 / _HZ, 0.02, 5.0)
    settings = FloorSettings(learn_s=0.5, start_s=0.2, rest_s=0.4, alone_s=0.2)
    estimator = FloorEstimator({"warm": Sensor(sweep, (0.0, 0.0, 0.0))}, settings)
    random = np.random.default_rng(0)
    for n in range(8 * _HZ):
        t = n / _HZ
        ranges = 3.0 + random.normal(0, 0.003, _BEAMS)
        if t > 2.0:
            walker = -1.0 + 0.35 * (t - 2.0)
            ranges[np.abs(angles - walker) < 0.05] = 1.5
            ranges[np.abs(angles - walker - 0.16) < 0.05] = 1.4
        if 3.5 < t < 6.5:
            ranges[np.abs(angles + 0.6) < 0.04] = 1.6
        estimator.scan("warm", t, ranges)
    estimator.labels()
    # Nothing here is black, nothing is a robot.
    dark_width(0, 0, 1.0, ranges, ranges, 0.01)
    one, scan = np.full(1, 0.2), (ranges, np.zeros(_BEAMS, np.int8), np.zeros((_BEAMS, 10)), np.zeros(3), -1.2, 0.02)
    weigh(1.0, 0.0, one, np.zeros((1, 1)), np.zeros(3), np.zeros(6), *scan)
