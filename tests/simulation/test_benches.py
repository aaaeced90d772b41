"""The demo's emulated devices, seen through the drivers and configurations of the real agents."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tms_agents.cabinet.calibration_file import read_calibration
from tms_agents.cabinet.config import CabinetConfig
from tms_agents.config import read_config
from tms_agents.devices.loadboard import RosTmsBoardSession
from tms_agents.devices.loads import LoadSample
from tms_agents.devices.tags import RoundEnd, TagItem, TagRead
from tms_agents.devices.tr3.session import Tr3Session
from tms_agents.hand.config import HandConfig
from tms_agents.hand.posture import Posture
from tms_agents.hand.setup import make_arm, make_robot
from tms_agents.hand.state_sources import TcpStates, open_states
from tms_agents.hand.states import StateLines, StateMessage
from tms_agents.simulation.cabinet_bench import CabinetBench
from tms_agents.simulation.catalogue import ITEMS
from tms_agents.simulation.hardware import Hardware, plugged_in
from tms_agents.simulation.installation import BOARD, install
from tms_agents.simulation.processes import running_agents
from tms_agents.simulation.robot_bench import GRIPPER, RobotBench, joints_of
from tms_agents.simulation.room import CABINETS, PERSON, ROBOT, ROBOT_AGENT, SPOTS, new_world
from tms_agents.simulation.world import Gripped, Held, World
from tms_client.cli import CommandError

MUG, BOTTLE = ITEMS[2], ITEMS[3]


class Desk:
    """A cabinet's devices on a desk, with their drivers; time goes on in ``run`` only."""

    def __init__(self, seed: int) -> None:
        self.now = 100.0
        self.bench = CabinetBench(CABINETS[2], np.random.default_rng(seed), clock=lambda: self.now)
        self.board = RosTmsBoardSession(clock=lambda: self.now)
        self.reader = Tr3Session(clock=lambda: self.now, poll_s=0.2)
        self.samples: list[LoadSample] = []
        self.items: list[TagItem] = []
        self.board.opened()
        self.reader.opened()

    def run(self, seconds: float) -> None:
        """The last samples and tag items are those of this time."""
        self.samples, self.items, end = [], [], self.now + seconds
        while self.now < end:
            self.now += 0.001
            self.board.tick()
            self.reader.tick()
            while sent := self.board.output():
                self.samples += self.board.receive(self.bench.board.receive(sent))
            while sent := self.reader.output():
                self.items += self.reader.receive(self.bench.reader.receive(sent))

    def grams(self) -> np.ndarray:
        calibration = self.bench.calibration()
        return np.mean([calibration.grams(one.values) for one in self.samples], axis=0)

    def tags(self) -> set[str]:
        return {one.tag for one in self.items if isinstance(one, TagRead)}


@pytest.mark.parametrize("seed", [0, 1])
def test_what_is_put_into_a_cabinet_is_weighed_and_read(seed: int) -> None:
    desk, world = Desk(seed), new_world()
    desk.run(2.0)
    assert abs(desk.grams().sum()) < 3.0
    assert len(desk.samples) > 90
    world.bring(MUG.tag, "cabinet-c", 1)
    desk.bench.follow(world)
    desk.run(1.0)
    desk.run(2.0)
    assert desk.grams().sum() == pytest.approx(MUG.weight_g, abs=4.0)
    xy = desk.grams() @ np.array(desk.bench.cells) / desk.grams().sum()
    assert math.dist(xy, CABINETS[2].spots[1]) < 0.02
    assert desk.tags() == {MUG.tag}
    assert any(isinstance(one, RoundEnd) for one in desk.items)
    world.movers[PERSON].xy = SPOTS["front of C"]
    world.take(PERSON, MUG.tag)
    desk.bench.follow(world)
    desk.run(1.0)
    desk.run(2.0)
    assert abs(desk.grams().sum()) < 4.0
    assert desk.tags() == set()


def test_a_tag_under_a_hand_is_not_read() -> None:
    desk, world = Desk(0), new_world()
    world.places[BOTTLE.tag] = Held(PERSON)
    world.movers[PERSON].xy = SPOTS["front of C"]
    world.put(PERSON, BOTTLE.tag, "cabinet-c", 3, cover=True)
    desk.bench.follow(world)
    desk.run(1.0)
    desk.run(1.0)
    assert desk.tags() == set()
    assert desk.grams().sum() == pytest.approx(BOTTLE.weight_g, abs=4.0)
    world.uncover(BOTTLE.tag)
    desk.bench.follow(world)
    desk.run(1.0)
    assert desk.tags() == {BOTTLE.tag}


def holding(tag: str) -> World:
    world = new_world()
    world.places[tag] = Gripped(ROBOT)
    return world


def test_the_robot_tells_what_its_fingers_do_and_its_reader_what_they_hold() -> None:
    bench, lines = RobotBench(ROBOT, np.random.default_rng(0)), StateLines()

    def said(ticks: int) -> Sequence[StateMessage]:
        return [message for _ in range(ticks) for message in lines.receive(bench.tick())]

    bench.follow(new_world())
    said(20)
    assert bench.is_firm
    assert bench.reader.look is not None and list(bench.reader.look(0)) == []
    bench.follow(holding(MUG.tag))
    assert not bench.is_firm
    widths = [one.gripper[GRIPPER].opening_m for one in said(20)]
    assert widths == sorted(widths, key=lambda width: -(width or 0.0))
    assert widths[0] is not None and 0.08 < widths[0] < 0.1
    assert widths[-1] == 0.06 and bench.is_firm
    looks = [list(bench.reader.look(0)) for _ in range(50)]
    assert [MUG.tag] in looks and [] in looks and list(bench.reader.look(1)) == []


@pytest.mark.parametrize("hand", [(0.4, 1.1), (0.4, 0.8), (0.763, 0.8), (0.2, 0.5)])
def test_forward_kinematics_find_the_gripper_where_the_arm_was_sent(tmp_path: Path, hand: tuple[float, float]) -> None:
    config = installed(tmp_path)[0]
    arm = config.hands[0].arm
    assert arm is not None
    posture = Posture({GRIPPER: make_arm(arm)})
    shoulder, elbow = joints_of(hand)
    posture.update(StateMessage(joints={"shoulder": shoulder, "elbow": elbow}, base=(1.0, 2.0, math.pi / 2)))
    spot = posture.spot(GRIPPER, None)
    assert spot is not None and spot.z == pytest.approx(hand[1], abs=1e-6)
    assert spot.xy == pytest.approx((1.0, 2.0 + hand[0]), abs=1e-6)


def test_an_arm_is_only_so_long() -> None:
    with pytest.raises(ValueError, match="does not reach"):
        joints_of((1.2, 0.9))


def installed(folder: Path) -> tuple[HandConfig, dict[str, CabinetConfig]]:
    with plugged_in(0) as hardware:
        configs = install(folder, hardware, "http://127.0.0.1:1", "demo")
        hand = read_config(configs[ROBOT_AGENT], HandConfig)
        make_robot(hand, lambda: "robot/1")
        return hand, {name: read_config(path, CabinetConfig) for name, path in configs.items() if name != ROBOT_AGENT}


def test_the_installation_is_what_the_agents_read(tmp_path: Path) -> None:
    _, cabinets = installed(tmp_path)
    assert cabinets.keys() == {one.id for one in CABINETS}
    for cabinet in CABINETS:
        config = cabinets[cabinet.id]
        (board,) = config.boards
        frame = board.frame()
        for spot, slot in zip(cabinet.spots, cabinet.slots, strict=True):
            assert frame.point(spot) == pytest.approx(slot, abs=1e-5)
        calibration = read_calibration(config.calibration_path(tmp_path / f"{cabinet.id}.toml"))
        assert len(calibration[BOARD].gain) == len(board.cells or ()) == 4


def test_devices_are_plugged_in_and_pulled_out() -> None:
    with plugged_in(0) as hardware:
        assert isinstance(hardware, Hardware)
        host, port = hardware.plugs[ROBOT_AGENT].states or ("", 0)
        hardware.follow(holding(MUG.tag))
        message = asyncio.run(first_state(host, port))
        assert message.base == pytest.approx((*SPOTS["dock"], 1.57), abs=1e-3)
        paths = [Path(one) for plugs in hardware.plugs.values() for one in (plugs.reader, plugs.loads) if one]
        assert len(paths) == 7 and all(path.is_char_device() for path in paths)
    assert not any(path.exists() for path in paths)
    with pytest.raises(ConnectionRefusedError):
        asyncio.run(asyncio.open_connection(host, port))


def test_an_impossible_wish_is_told_to_the_caller() -> None:
    with plugged_in(0) as hardware:
        far = new_world()
        far.movers[ROBOT].hand = (3.0, 1.0)
        with pytest.raises(ValueError, match="does not reach"):
            hardware.follow(far)


async def first_state(host: str, port: int) -> StateMessage:
    async for item in open_states(TcpStates(kind="tcp", host=host, port=port), silent_after_s=5.0):
        if isinstance(item, list) and item:
            message: StateMessage = item[0]
            return message
    raise AssertionError("the robot says nothing")


def test_an_agent_that_ends_is_named_with_its_last_words(tmp_path: Path) -> None:
    config = tmp_path / "cabinet-a.toml"
    config.write_text("agent = 1")
    died = pytest.raises(CommandError, match=r"agent cabinet-a ended with status 2: tms: .*cabinet-a\.toml")
    with running_agents({"cabinet-a": config}, "http://127.0.0.1:1", None) as agents, died:
        for _ in range(600):
            agents.require_alive()
            time.sleep(0.05)
