"""A scripted world: scans of its lasers in the order of time, and the truth about them at the end."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tms_agents.simulation.floor_world.furnishing import furnish, live_room
from tms_agents.simulation.floor_world.gait import FeetKind
from tms_agents.simulation.floor_world.lasers import FINE, Laser, Mount
from tms_agents.simulation.floor_world.life import Life
from tms_agents.simulation.floor_world.scenarios import ROBOT_SIZE, SCENARIOS
from tms_agents.simulation.floor_world.shapes import Floats, Ints, Xy, box_corners
from tms_agents.simulation.floor_world.truth import Witness


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One scan: ``t`` s of its first beam as its sensor says, ``ranges`` and ``intensities`` (n,).

    ``owners`` (n,) is whose each beam has met (`room.owner`; -1: nobody's), for who judges an estimator.
    """

    sensor: str
    t: float
    ranges: Floats
    intensities: Floats
    owners: Ints


@dataclass(frozen=True, kw_only=True, slots=True)
class Known:
    """What an installer knows of the room and may tell an estimator: polygons, segments, (width, length) of robots."""

    region: list[Xy]
    gates: list[list[Xy]]
    seats: list[list[Xy]]
    mirrors: list[tuple[Xy, Xy]]
    robots: list[tuple[float, float]]


class FloorWorld:
    """One scenario with one seed. ``scans`` plays it, once; afterwards ``truth`` tells what was.

    ``duration`` shortens or lengthens the scenario. Raises ValueError for an unknown scenario.
    """

    def __init__(
        self,
        scenario: str,
        seed: int,
        *,
        feet: FeetKind = "prints",
        laser: Laser = FINE,
        duration: float | None = None,
    ) -> None:
        if scenario not in SCENARIOS:
            raise ValueError(f"no scenario {scenario!r}; there are {', '.join(SCENARIOS)}")
        self.name, self.seed, self._script = scenario, seed, SCENARIOS[scenario]
        self.duration = self._script.duration if duration is None else duration
        # Both kinds of feet live in the same room: what differs is only what the laser sees of them.
        rooms, devices, lives = np.random.default_rng([seed, *scenario.encode()]).spawn(3)
        home = furnish(self._script.setting, laser, rooms)
        self.room = live_room(home, devices, feet)
        self.life = Life(home.plan, self.room, lives)
        self._witness = Witness(self.life)
        self._script.write(self.life, self.duration)

    @property
    def sensors(self) -> dict[str, Mount]:
        """By name, with the poses as reported to the user (and the true ones, which are none of his business)."""
        return self.room.mounts

    def known(self) -> Known:
        """The plan of the room, where the bed stands, the robots of the house."""
        plan = self.life.plan
        bed = self.room.furniture["bed"]
        return Known(
            region=plan.outline(),
            gates=[plan.gate(door) for door in plan.doors],
            seats=[box_corners(bed.pose, bed.width, bed.depth)],
            mirrors=[(wall.a, wall.b) for wall in self.room.walls if wall.material.mirror],
            robots=[ROBOT_SIZE],
        )

    def scans(self) -> Iterator[Frame]:
        """Play it."""
        due = {name: 0.35 * i * mount.laser.period_s for i, (name, mount) in enumerate(self.room.mounts.items())}
        while (name := min(due, key=lambda name: due[name])) and due[name] < self.duration:
            t, errors = due[name], self.room.errors[name]
            self.life.advance(t)
            measured, _ = self.room.look(name, t)
            stamp = max(0.0, t + errors.jitter())
            self._witness.saw(name, stamp, measured)
            yield Frame(name, stamp, measured.ranges, measured.intensities, measured.owners)
            due[name] = t + errors.period()

    def truth(self) -> dict[str, Any]:
        """As in the JSON files of `data/floor/sim`, of what was played so far."""
        script = self._script
        return self._witness.truth(self.name, self.seed, self.duration, script.quiet_s, script.description)


def write(world: FloorWorld, folder: Path, name: str) -> list[Path]:
    """Play a world into ``folder``: NAME.json, and NAME_SENSOR.npz per laser; see `data/floor/README.md`."""
    scans: dict[str, list[Frame]] = {sensor: [] for sensor in world.sensors}
    for frame in world.scans():
        scans[frame.sensor].append(frame)
    truth = world.truth()
    written = []
    for sensor, frames in scans.items():
        mount = world.sensors[sensor]
        sweep = mount.laser.sweep()
        path = folder / f"{name}_{sensor}.npz"
        np.savez_compressed(
            path,
            ranges=np.array([frame.ranges for frame in frames], dtype=np.float32),
            t=np.array([frame.t for frame in frames]),
            angles=sweep.angles.astype(np.float32),
            time_increment=sweep.time_increment_s,
            sensor_pose=np.array(mount.reported),
            range_min=sweep.range_min_m,
            range_max=sweep.range_max_m,
            scan_rate=1 / sweep.period_s,
            sigma_hint=float(np.interp(3.0, mount.laser.noise.sigma_at_m, mount.laser.noise.sigma_m)),
            model=sweep.model,
        )
        next(one for one in truth["sensors"] if one["name"] == sensor)["file"] = path.name
        written.append(path)
    (folder / f"{name}.json").write_text(json.dumps(truth))
    return [folder / f"{name}.json", *written]
