"""``tms demo --robot``: a robot maps a ward; a door is closed while it is parked; the server says which are open."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tms_agents.simulation.processes import Agents, running_agents
from tms_agents.simulation.room import MAPPER_AGENT
from tms_agents.simulation.service import server
from tms_agents.simulation.terminal import Terminal
from tms_client import NotFound, Retry, Town, TownError
from tms_client.cli import CommandError
from tms_schemas.maps import MapVersion
from tms_schemas.objects import ObjectFields, Shape
from tms_schemas.rooms import RoomIn, Sensor

if TYPE_CHECKING:
    from tms_agents.simulation.demo import Plan
    from tms_agents.simulation.robot_stage import RobotStage

#: The estimator compiles at its first start.
_CONNECT_S, _UPDATE_S = 60.0, 180.0
_PARKED_S = 2.0
_NAMES = ("Door of room 1", "Door of room 2", "Bin at the window", "Bin at the wall")


def run(plan: Plan, terminal: Terminal, sleep: Callable[[float], object] = time.sleep) -> bool:
    """True where the server's doors were at the end as they are in the ward.

    Raises:
        CommandError: something is missing, an agent ended, or the server refused.
    """
    try:
        from tms_agents.simulation.robot_stage import robot_on_stage
        from tms_agents.simulation.semidynamic_plans import PLANS
    except ImportError as error:
        raise CommandError(f'the robot\'s mapper needs {error.name}: pip install "robot-town-tms[slam]"') from error

    layout = PLANS["ward"](np.random.default_rng([plan.seed, 7]))
    tags = [f"E2F0{plan.seed % 0x10000:04X}{number:016X}" for number in range(len(layout.things))]
    with ExitStack() as stack:
        work = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="tms-demo-")))
        url = plan.url or stack.enter_context(server(plan.data_dir or work / "data", plan.port, terminal.say))
        town = stack.enter_context(Town(url, plan.key, retry=Retry(attempts=8)))
        stage = stack.enter_context(robot_on_stage(layout, tags, plan.seed, plan.speed))
        try:
            register(town, plan.room, stage)
            terminal.say(
                f"The page: {url}/\nA robot maps room {plan.room!r}. The server knows the shapes of what has tags."
            )
            config = work / "mapper.toml"
            config.write_text(configuration(stage, plan.room))
            agents = stack.enter_context(running_agents({MAPPER_AGENT: config}, url, plan.key))
            terminal.say(
                f"  {MAPPER_AGENT}: Pioneer {stage.base_path}; SCIP laser tcp 127.0.0.1:{stage.laser_port}; "
                f"LLRP reader tcp 127.0.0.1:{stage.reader.port}; tms agent robot --config {config}"
            )
            right = _Story(town, plan.room, stage, agents, terminal.say, sleep).play()
            if not plan.once:
                terminal.say(f"\nThe map stays; look at {url}/ (Ctrl-C ends it).")
                while True:
                    sleep(1.0)
        except TownError as error:
            raise CommandError(str(error)) from error
    return right


def register(town: Town, room: str, stage: RobotStage) -> None:
    """The ward, and what has tags in it: name, shape, tag pose. Nobody tells where anything is."""
    corners = stage.plan.walls.reshape(-1, 2)
    (x0, y0), (x1, y1) = corners.min(axis=0) - 0.3, corners.max(axis=0) + 0.3
    outline = [(float(x), float(y)) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
    town.rooms.put(room, RoomIn(name="Ward", outline=outline, sensors=[Sensor(agent=MAPPER_AGENT, kind="robot")]))
    with contextlib.suppress(NotFound):
        town.maps.delete(map_id(room))  # of a former demo
    for tag, thing, name in zip(stage.tags, stage.plan.things, _NAMES, strict=True):
        polygon = [(float(x), float(y)) for x, y in thing.parts[0]]
        shape = Shape.model_validate({"class": thing.kind, "polygon": polygon})
        town.objects.put(tag, ObjectFields(name=name, room=room, tracking="map", shape=shape, tag_pose=thing.tag))


def configuration(stage: RobotStage, room: str) -> str:
    """Of ``tms agent robot``."""
    from tms_agents.simulation.semidynamic_drive import LASER

    antennas = "".join(
        f"\n[[live.antennas]]\nnumber = {number}\npose = {list(pose)}\n"
        for number, pose in enumerate(stage.plan.antennas, 1)
    )
    numbers = list(range(1, len(stage.plan.antennas) + 1))
    return f"""agent = "{MAPPER_AGENT}"
room = "{room}"

[spool]
path = "{MAPPER_AGENT}.spool"

[map]
id = "{map_id(room)}"
start = {list(stage.start)}
every_s = 5.0

[objects]
parked_s = {_PARKED_S}

[live]
laser_pose = {list(LASER)}
range_max_m = 8.0
laser = {{ kind = "scip", host = "127.0.0.1", port = {stage.laser_port}, cluster = 3, skip = 3, intensity = false }}
base = {{ device = "{stage.base_path}" }}
reader = {{ kind = "llrp", host = "127.0.0.1", port = {stage.reader.port}, antennas = {numbers}, round_s = 0.06 }}
{antennas}"""


def map_id(room: str) -> str:
    return room.replace(".", "-")


class _Story:
    def __init__(
        self,
        town: Town,
        room: str,
        stage: RobotStage,
        agents: Agents,
        say: Callable[[str], None],
        sleep: Callable[[float], object],
    ) -> None:
        self._town, self._room, self._stage, self._agents = town, room, stage, agents
        self._say, self._sleep = say, sleep
        self._version = self._legs = 0

    def play(self) -> bool:
        stage = self._stage
        self._wait(lambda: stage.listened_to, _CONNECT_S, "the agent does not find its devices")
        self._say("\n(1) The robot drives through the ward, and back.")
        right = self._leg()
        first = self._version
        self._say("\n(2) It is parked. Meanwhile a door is closed, another one opened, and what stood about is moved.")
        self._say("    It drives once more.")
        right = self._leg() and right
        self._say(f"\nWhat moved by more than 10 cm or 10 degrees since version {first}:")
        for one in self._town.maps.diff(
            map_id(self._room), first, least_m=0.1, least_rad=float(np.radians(10))
        ).objects:
            name = self._town.objects.get(one.tag).name
            if one.moved_m is None or one.turned_rad is None:
                self._say(f"    {name}: {'new' if one.before is None else 'gone'}")
            else:
                self._say(f"    {name}: {one.moved_m:.2f} m, {np.degrees(one.turned_rad):.0f} degrees")
        self._say(
            "The server's doors are as they are in the ward." if right else "The server's doors are NOT as in the ward."
        )
        return right

    def _leg(self) -> bool:
        """Drive, wait for the map of all of it, show the doors; whether they are right."""
        self._stage.drive()
        self._legs += 1
        self._wait(lambda: self._stage.standing, _UPDATE_S, "the robot does not arrive")
        self._wait(self._parked, _UPDATE_S, "the agent makes no map of the drive")
        doors = {one.tag: one for one in self._town.doors(self._room)}
        self._say("    Which doors are open? The server answers:")
        right = True
        for tag, closed in self._stage.closed.items():
            door = doors.get(tag)
            name = self._town.objects.get(tag).name
            said = "not seen" if door is None else door.state
            angle = "" if door is None or door.angle is None else f" ({np.degrees(door.angle):.0f} degrees)"
            fits = said == ("closed" if closed else "open")
            right = right and fits
            self._say(f"      {name}: {said}{angle}{'' if fits else '   NOT AS IT IS'}")
        return right

    def _parked(self) -> bool:
        """An update was made since the robot parked; new versions are told on the way. One that changes nothing makes
        no version, so the agent is listened to."""
        made = self._agents.said(MAPPER_AGENT, "INFO parked: ") >= self._legs
        self._new_versions()
        return made

    def _new_versions(self) -> None:
        try:
            versions = self._town.maps.versions(map_id(self._room))
            found = _until(versions, self._version)
        except NotFound:
            return
        for one in reversed(found):
            self._version = one.version
            known = self._town.map(map_id(self._room), version=one.version)
            area = np.isfinite(known.occupancy).sum() * known.resolution**2
            self._say(f"    version {one.version}: {area:5.1f} m2 known; {one.note}")

    def _wait(self, done: Callable[[], bool], patience_s: float, otherwise: str) -> None:
        until = time.monotonic() + patience_s
        while not done():
            self._agents.require_alive()
            if time.monotonic() > until:
                raise CommandError(f"{otherwise}: {self._agents.last_words(MAPPER_AGENT)}")
            if self._stage.listened_to and not self._stage.standing:
                self._new_versions()
            self._sleep(0.2)


def _until(versions: Iterable[MapVersion], known: int) -> list[MapVersion]:
    """The newest first, down to the one after ``known``."""
    found: list[MapVersion] = []
    for one in versions:
        if one.version <= known:
            break
        found.append(one)
    return found
