"""A robot's devices, emulated byte for byte, in a simulated ward: a Pioneer's wheels, a Hokuyo laser, an LLRP reader.

It drives the route of a plan of ``semidynamic_plans``, leg by leg; between two legs it is parked, and things are moved.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable, Iterator
from contextlib import AsyncExitStack, contextmanager

import numpy as np

from tms_agents.devices.arcos import PioneerDevice
from tms_agents.devices.emulation import PtyLine, TcpLine
from tms_agents.devices.llrp.emulator import LlrpEmulator
from tms_agents.devices.scans import Array
from tms_agents.devices.scip import ScipDevice
from tms_agents.devices.tags import TagRead
from tms_agents.simulation.floor_world.raycaster import cast
from tms_agents.simulation.floor_world.shapes import Shapes
from tms_agents.simulation.hardware import served
from tms_agents.simulation.semidynamic_drive import (
    LASER,
    Devices,
    compose,
    driven,
    odometry_of,
    pose_at,
    power_at,
    surfaces,
)
from tms_agents.simulation.semidynamic_plans import Plan

#: How often the reader looks for tags, and how often what it may see is made anew (s).
_LOOK_S, _TICK_S = 0.05, 0.01
_REACH_M = 8.0
Pose = tuple[float, float, float]


class RobotStage:
    """``drive`` begins the next leg, ``standing`` tells when it has ended. ``tags`` in the order of the plan's things.

    ``speed``: the robot moves so many times faster; its devices keep real time. Made by ``robot_on_stage``.
    """

    def __init__(
        self, plan: Plan, tags: list[str], seed: int, speed: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.plan, self.tags = plan, tags
        self._speed, self._clock = speed, clock
        wheels, self._noise, self._radio = np.random.default_rng([seed, 3]).spawn(3)
        self._how = Devices()
        self._t, self._truth, legs = driven(plan)
        self._odometry = odometry_of(self._t, self._truth, self._how, wheels)
        self._legs = [(float(self._t[legs == n][0]), float(self._t[legs == n][-1])) for n in np.unique(legs)]
        self._fading = {tag: self._radio.normal(0, self._how.fading_db, (97, 97)) for tag in tags}
        self._leg, self._began = -1, 0.0
        self.base = PioneerDevice(motion=lambda: self._now(self._odometry), clock=clock)
        self.laser = ScipDevice(self._scan, clock=clock)
        self.reader = LlrpEmulator(period_s=_LOOK_S)
        self.base_port = self.laser_port = 0
        self.base_path = ""
        self._unplug = asyncio.Event()

    @property
    def start(self) -> Pose:
        """Where the robot stands at first, in the ward."""
        x, y, theta = (float(one) for one in self._truth[0])
        return x, y, theta

    @property
    def listened_to(self) -> bool:
        """Whether somebody uses all three devices."""
        return self.base.open and self.laser.laser_on and "ENABLE_ROSPEC" in self.reader.heard

    @property
    def standing(self) -> bool:
        """The leg is over, or none has begun."""
        return self._leg < 0 or self._world_s() >= self._legs[self._leg][1]

    @property
    def closed(self) -> dict[str, bool]:
        """Of each door by its tag, as it is now."""
        things = zip(self.tags, self.plan.things, strict=True)
        at = max(self._leg, 0)
        return {tag: abs(one.poses[at][2] - one.closed) < 1e-6 for tag, one in things if one.closed is not None}

    def drive(self) -> None:
        """Things are where they are in the next leg from now on, and the robot drives it."""
        self._leg, self._began = self._leg + 1, self._clock()

    def _world_s(self) -> float:
        """Time of the plan."""
        if self._leg < 0:
            return self._legs[0][0]
        begin, end = self._legs[self._leg]
        return min(begin + (self._clock() - self._began) * self._speed, end)

    def _now(self, poses: Array) -> Pose:
        x, y, theta = (float(one) for one in pose_at(self._t, poses, self._world_s()))
        return x, y, theta

    def _scan(self) -> tuple[Array, Array | None]:
        walls, _ = surfaces(self.plan, [max(self._leg, 0)] * len(self.plan.things))
        still = np.column_stack([walls, np.zeros((len(walls), 2))])
        none = np.zeros((0, 5)), np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        shapes = Shapes(still, np.full(len(walls), -1, dtype=np.int64), np.zeros((len(walls), 3)), *none)
        x, y, theta = compose(self._now(self._truth), LASER)
        angles = self.laser.sweep.angles
        step = float(angles[-1] - angles[0]) / (len(angles) - 1)
        met = cast(shapes, (float(x), float(y), float(theta)), float(angles[0]), step, len(angles), 0.0).ranges
        ranges = met + self._noise.normal(0, self._how.noise_m, len(met))
        gone = (met > _REACH_M) | (self._noise.random(len(met)) < self._how.lost)
        return np.where(gone, np.inf, np.maximum(ranges, 0.05)), None

    def _look(self) -> None:
        """Which tags each antenna may read now."""
        pose = np.array(self._now(self._truth))
        spot = (pose[:2] / 0.15).astype(int) % 97
        self.reader.tags.clear()
        for tag, thing in zip(self.tags, self.plan.things, strict=True):
            there = compose(thing.poses[max(self._leg, 0)], thing.tag)
            for number, antenna in enumerate(self.plan.antennas, 1):
                power = power_at(compose(pose, antenna), there, self.plan.walls, self._how)
                if power + self._fading[tag][spot[0], spot[1]] > 0 and self._radio.random() < self._how.works:
                    read = TagRead(tag=tag, antenna=number, rssi_dbm=round(-60 + power))
                    self.reader.tags[f"{tag} {number}"] = read

    async def serve(self, ready: Callable[[], object]) -> None:
        async with AsyncExitStack() as stack:
            wheels = await stack.enter_async_context(PtyLine(self.base, tick_s=_TICK_S))
            laser = await stack.enter_async_context(TcpLine(self.laser, tick_s=_TICK_S / 2))
            await stack.enter_async_context(self.reader)
            self.base_path, self.laser_port = wheels.path, laser.port
            ready()
            while not self._unplug.is_set():
                self._look()
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(_LOOK_S):
                        await self._unplug.wait()

    def start_devices(self) -> Callable[[], None]:
        """Plug in; the answer pulls all plugs."""
        return served(asyncio.new_event_loop(), self.serve, self._unplug)


@contextmanager
def robot_on_stage(plan: Plan, tags: list[str], seed: int, speed: float) -> Iterator[RobotStage]:
    stage = RobotStage(plan, tags, seed, speed)
    stop = stage.start_devices()
    try:
        yield stage
    finally:
        stop()
