"""The robot agent that maps with objects: records in, updates of SLAM-SD out, map and objects to the server.

An update estimates everything since the drive began anew, in a process of its own, so that neither records nor the
spool wait for it. One is under way at a time; the next one takes what is there by then. How long it took is told with
the version that it made.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import time
from collections.abc import AsyncGenerator, Callable
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from datetime import UTC, datetime

import numpy as np

from tms_agents.devices.transport import DeviceState
from tms_agents.robot.config import LiveSource, LogSource, ObjectsSection, RobotConfig
from tms_agents.robot.estimating import Update
from tms_agents.robot.estimator import Estimator
from tms_agents.robot.live_devices import device_records
from tms_agents.robot.map_uploader import Grid, MapUploader
from tms_agents.robot.records import Drive, Pose, Record, Snapshot, placed
from tms_agents.robot.replaying import replayed
from tms_agents.robot.shapes import Shapes
from tms_agents.robot.updates import Earlier, Online, Robot, map_objects
from tms_agents.running import Posted, Running, running
from tms_agents.slam.geometry import Floats, between
from tms_agents.slam.semidynamic import Antenna, parse_models
from tms_agents.slam.settings import Settings
from tms_agents.state import load_state, save_state, state_path
from tms_client import NotFound, Town, TownError, Unreachable
from tms_client.cli import CommandError
from tms_client.flows import NO_RETRY
from tms_schemas.maps import MapIn
from tms_schemas.observation import Inventory, PoseReport

log = logging.getLogger(__name__)
#: The robot's pose is told where it moved, so often at most.
_TELL_S, _TELL_M, _TELL_RAD = 0.5, 0.05, 0.05


async def run(
    config: RobotConfig,
    robot: Robot,
    *,
    drain_s: float,
    clock: Callable[[], float] = time.time,
    even: Callable[[], float] = time.monotonic,
) -> Posted:
    """Map until the recording ends or the task is cancelled; a recording is mapped to its end.

    ``clock`` gives Unix time, ``even`` seconds that never jump.

    Raises:
        SpoolError: the spool cannot be opened.
    """
    assert config.objects is not None
    posted = Posted()
    live = config.live is not None
    items = device_records(config.live, clock) if config.live is not None else _recording(config, even)
    with (
        Town(config.server.url, config.server.key, retry=NO_RETRY) as town,
        ThreadPoolExecutor(1, "server") as thread,
        contextlib.closing(Estimator()) as estimator,
    ):
        async with running(
            config, drain_s=drain_s, heartbeat_s=config.heartbeat_s, posted=posted, clock=clock
        ) as agent:
            mind = _Mind(config, config.objects, robot, town, thread, estimator, live=live, clock=clock, even=even)
            await agent.observations(Inventory(seq=0, observed_at=agent.now(), labels=[]))
            await mind.work(items, agent, drain_s)
    return posted


def robot_of(source: LogSource | LiveSource) -> Robot:
    """Raises ``CommandError`` where ``models.json`` of a recording cannot be read."""
    if isinstance(source, LiveSource):
        antennas = {one.number: Antenna(np.array(one.pose), one.range_m, one.half_beam_rad) for one in source.antennas}
        return Robot(np.array(source.laser_pose), antennas)
    path = source.models or source.path.with_name("models.json")
    try:
        source.path.open("rb").close()
        # What it says of tagged things is left aside: the server is asked for them.
        models = parse_models(json.dumps(json.loads(path.read_text()) | {"tags": {}}))
    except OSError as error:
        raise CommandError(f"{error.filename}: {error.strerror}") from error
    except (ValueError, TypeError) as error:
        raise CommandError(f"{path}: {error}") from error
    return Robot(models.laser, models.antennas)


def _recording(
    config: RobotConfig, even: Callable[[], float]
) -> AsyncGenerator[tuple[str, Record | DeviceState], None]:
    assert config.source is not None
    return replayed(config.source, even)


class _Mind:
    def __init__(
        self,
        config: RobotConfig,
        section: ObjectsSection,
        robot: Robot,
        town: Town,
        thread: ThreadPoolExecutor,
        estimator: Estimator,
        *,
        live: bool,
        clock: Callable[[], float],
        even: Callable[[], float],
    ) -> None:
        self._config, self._town, self._thread, self._estimator = config, town, thread, estimator
        self._live, self._clock, self._even = live, clock, even
        self._shapes = Shapes(town, log.warning)
        self._uploader = MapUploader(town, config.map.id, config.agent, config.map.every_s, log.warning)
        settings = Settings(particles=config.map.particles, seed=config.map.seed)
        drive = Drive(robot.laser, section.parked_s, section.most_scans)
        self._online = Online(robot, drive, settings, config.resolution, config.map.every_s)
        self._told: Pose | None = None
        self._told_at = -np.inf
        self._ahead_s = 0.0
        self._continues, self._map_to_room = section.continues, config.map.start
        self._state = state_path(config.spool.path)
        self._there = self._said_full = False
        self._trouble = ""

    async def work(
        self, items: AsyncGenerator[tuple[str, Record | DeviceState], None], agent: Running, drain_s: float
    ) -> None:
        label = agent.new_label()
        if self._continues:
            await asyncio.get_running_loop().run_in_executor(self._thread, self._go_on)
        update: asyncio.Task[None] | None = None
        try:
            async with contextlib.aclosing(items) as arriving:
                async for name, item in arriving:
                    if isinstance(item, DeviceState):
                        await agent.device(name, agent.now(), item)
                        continue
                    self._take(item)
                    await self._tell(agent, label)
                    if update is not None and update.done():
                        update.result()  # a mistake of ours is not passed over in silence
                        update = None
                    if update is None and (why := self._online.due(self._even())):
                        update = asyncio.create_task(self._update(why))
            if update is not None:
                await update
            await self._update("the whole drive", patience_s=drain_s)
            await self._tell(agent, label, now=True)
        finally:
            self._remember()
            if update is not None:
                update.cancel()
                await asyncio.gather(update, return_exceptions=True)

    def _go_on(self) -> None:
        """Takes over the server's map, where there is one and the robot knows where it is in it."""
        about = self._config.map
        try:
            found = self._town.map(about.id)
        except (NotFound, Unreachable) as error:
            log.warning("map %s is made anew: %s", about.id, error)
            return
        pose = _pose_in(found.map_to_room, about.start)
        saved = load_state(self._state, self._config.agent)
        if saved.get("map") == about.id:
            pose = np.array(saved["pose"], dtype=np.float64)
        if not found.version or pose is None or abs(found.resolution - self._config.resolution) > 1e-9:
            log.warning("map %s is made anew: it is empty, of other cells, or the robot's place is not known", about.id)
            return
        self._online.earlier = Earlier(
            found.occupancy.astype(np.float64), found.origin, found.resolution, found.objects, pose, found.map_to_room
        )
        self._map_to_room = found.map_to_room
        log.info("map %s goes on from version %d", about.id, found.version)

    def _remember(self) -> None:
        """Where the robot is in the map, for the next run."""
        if self._online.updates and (pose := self._online.pose()) is not None:
            save_state(self._state, self._config.agent, {"map": self._config.map.id, "pose": list(pose)})

    def _take(self, record: Record) -> None:
        drive = self._online.drive
        drive.take(record)
        if not self._live:
            t = record.t if hasattr(record, "t") else record.scan[0]
            self._ahead_s = self._clock() - t
        if drive.full and not self._said_full:
            self._said_full = True
            log.error("%d scans are as many as are taken; what comes now is not mapped", drive.most_scans)

    async def _tell(self, agent: Running, label: str, *, now: bool = False) -> None:
        start, pose = self._map_to_room, self._online.pose()
        if start is None or pose is None or (not now and self._even() - self._told_at < _TELL_S):
            return
        there = placed(np.array(start), pose)
        if self._told is not None and not now and not _moved(self._told, there):
            return
        self._told, self._told_at = there, self._even()
        at = datetime.fromtimestamp(self._clock(), UTC)
        await agent.observations(PoseReport(seq=0, observed_at=at, label=label, pose=there))

    async def _update(self, why: str, patience_s: float | None = None) -> None:
        loop = asyncio.get_running_loop()
        tags = set(self._online.drive.tags)
        if self._online.earlier is not None:
            tags |= {one.tag for one in self._online.earlier.objects}
        await loop.run_in_executor(self._thread, self._shapes.learn, tags)
        made = self._online.task(self._even(), self._shapes.known)
        if made is None:
            return
        snapshot, task = made
        if self._online.drive.parked and patience_s is None:
            why = "parked"  # meanwhile
        try:
            update = await self._estimator(task)
        except (ValueError, ArithmeticError, IndexError, BrokenProcessPool, np.linalg.LinAlgError) as error:
            log.error("no update (%s): %s: %s", why, type(error).__name__, error)
            return
        self._online.taken(snapshot, update)
        self._remember()
        await loop.run_in_executor(self._thread, self._send, snapshot, update, why, patience_s)
        log.info("%s: %s", why, in_words(snapshot, update))

    def _send(self, snapshot: Snapshot, update: Update, why: str, patience_s: float | None) -> None:
        """A refusal is said once; the robot drives on."""
        grid = Grid(update.occupancy, update.origin)
        earlier = self._online.earlier
        objects = map_objects(update, snapshot.times, self._ahead_s, () if earlier is None else earlier.objects)
        note = f"{why}: {in_words(snapshot, update)}"
        try:
            self._require()
            if patience_s is None:
                self._uploader.send(grid, note, objects)
            else:
                made = self._uploader.finish(grid, patience_s, note, objects)
                log.info("map %s is at version %d", self._config.map.id, made.version)
        except TownError as error:
            if str(error) != self._trouble:
                self._trouble = str(error)
                log.error("map %s: %s", self._config.map.id, error)

    def _require(self) -> None:
        if not self._there and self._online.earlier is None:
            about = self._config.map
            fields = MapIn(room=self._config.room, resolution=self._config.resolution, map_to_room=about.start)
            self._town.maps.put(about.id, fields)
            self._there = True


def in_words(snapshot: Snapshot, update: Update) -> str:
    doors = [one.door.state for one in update.objects.values() if one.door is not None]
    return (
        f"{len(snapshot.log)} scans, {len(update.objects)} objects, {doors.count('open')} of {len(doors)} doors open, "
        f"computed in {update.seconds:.1f} s ({update.cpu_seconds:.1f} s of processor)"
    )


def _pose_in(frame: Pose | None, pose: Pose | None) -> Floats | None:
    return None if frame is None or pose is None else between(np.array(frame), np.array(pose))


def _moved(one: Pose, other: Pose) -> bool:
    turned = abs((other[2] - one[2] + np.pi) % (2 * np.pi) - np.pi)
    return bool(np.hypot(other[0] - one[0], other[1] - one[1]) > _TELL_M or turned > _TELL_RAD)
