"""Whether the floor estimator grows over a day: resident memory, all that it remembers, and how many labels it tells.

Half an hour of people who come, stand, put things down and go is played again and again, every scan of it.
"""

from __future__ import annotations

import gc
import json
import time
from pathlib import Path

import numpy as np
from floor_contestants import Ours

from tms_agents.simulation.floor_world import FloorWorld, Frame

#: Length of the block, and how often labels are counted (scans).
BLOCK_S, LOOK = 1800.0, 100


def memory(hours: float, seed: int = 1000) -> None:
    """One row for each simulated hour."""
    block_s = min(BLOCK_S, 1800 * hours)
    world = FloorWorld("standing", seed, duration=block_s)
    scans = [_small(frame) for frame in world.scans()]
    floor = Ours({name: (mount.laser.sweep(), mount.reported) for name, mount in world.sensors.items()}, world.known())
    lap_s = scans[-1].t + 0.1
    laps, begin = max(2, round(3600 * hours / lap_s)), time.process_time()
    print(f"### Memory of the estimator over {laps * lap_s / 3600:.1f} simulated hours: {laps} times {lap_s:.0f} s\n")
    print("| simulated hours | resident MB | its state, kB | labels given | movers, things told: mean (most) |")
    print("|---|---|---|---|---|", flush=True)
    resident: list[float] = []
    movers: list[int] = []
    things: list[int] = []
    for lap in range(laps):
        for k, scan in enumerate(scans):
            floor.scan(scan.sensor, scan.t + lap * lap_s, scan.ranges.astype(float), scan.intensities.astype(float))
            if k % LOOK == 0:
                kinds = [one["attr"] for one in floor.labels()]
                movers.append(kinds.count("mover"))
                things.append(kinds.count("object"))
        if (lap + 1) * lap_s < 3600 * (len(resident) + 1) and lap + 1 < laps:
            continue
        state = floor.estimator.to_dict()
        size = len(json.dumps(state)) / 1e3
        given = int(state["labels"])
        del state
        gc.collect()
        resident.append(resident_mb())
        told = f"{np.mean(movers):.1f} ({max(movers)}), {np.mean(things):.1f} ({max(things)})"
        print(f"| {(lap + 1) * lap_s / 3600:.2f} | {resident[-1]:.1f} | {size:.0f} | {given} | {told} |", flush=True)
        movers, things = [], []
    growth, spent = resident[-1] - resident[0], time.process_time() - begin
    print(f"\nGrowth after the first row: {growth:.2f} MB; {spent:.0f} s CPU for {laps * len(scans)} scans\n")


def resident_mb() -> float:
    """Of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def _small(frame: Frame) -> Frame:
    """Half as large, and nothing of the truth."""
    nobody = np.zeros(0, np.int64)
    return Frame(frame.sensor, frame.t, frame.ranges.astype(np.float32), frame.intensities.astype(np.float32), nobody)
