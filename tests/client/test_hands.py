"""Robots that know what they grasp, against the real server: what it believes after each thing they do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from server_process import ServerProcess

from tms_client import AsyncTown, NotFound, Retry, Spool, SpoolError, Town, TownError
from tms_schemas.objects import ObjectFields
from tms_schemas.observation import (
    LabelAppeared,
    LabelMoved,
    LabelVanished,
    MoverEntered,
    Observation,
    ObservationBatch,
    TagObserved,
)
from tms_schemas.rooms import RoomIn

TEA, CUP = "E00401004E17F97A", "E00401004E17F97B"
OTHERS = [f"E0040100000000{n:02X}" for n in range(4)]
CABINET, TABLE = [[0, 0], [1, 0], [1, 0.5], [0, 0.5]], [[3, 0], [4, 0], [4, 1], [3, 1]]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    with ServerProcess(tmp_path_factory.mktemp("server")) as server:
        yield server


class Room:
    """A room of its own: a smart cabinet with six things, a laser at the floor that sees robot and person, a table."""

    def __init__(self, url: str, name: str, folder: Path) -> None:
        self.name, self.url, self.folder = name, url, folder
        self.town = Town(url)
        self.now = datetime.now(UTC) - timedelta(hours=1)
        self._seq = {"cab": 0, "floor": 0}
        furniture = [
            {"id": "cabinet", "name": "cabinet", "polygon": CABINET, "agent": f"{name}-cab"},
            {"id": "table", "name": "table", "polygon": TABLE},
        ]
        sensors = [{"agent": f"{name}-cab", "kind": "cabinet"}, {"agent": f"{name}-floor", "kind": "floor"}]
        outline = [[0, 0], [5, 0], [5, 4], [0, 4]]
        self.town.rooms.put(
            name,
            RoomIn.model_validate({"name": "Lab", "outline": outline, "furniture": furniture, "sensors": sensors}),
        )
        self.tags = {tag: f"{tag[:-2]}{hash((name, tag)) & 0xFFFFFF:06X}{tag[-2:]}" for tag in (TEA, CUP, *OTHERS)}
        for n, tag in enumerate(self.tags.values()):
            self.town.objects.put(tag, ObjectFields(name=f"thing {n}", room=name))
        for n, tag in enumerate(self.tags.values()):
            self.cabinet(LabelAppeared, n, kind="cabinet", xy=(0.05 + 0.1 * n, 0.2), tag=tag)
        self.floor(MoverEntered, 0, xy=(0.5, 1.0))  # the robot
        self.floor(MoverEntered, 1, xy=(1.2, 1.0))  # a person near it

    def tick(self, seconds: float = 1.0) -> datetime:
        self.now += timedelta(seconds=seconds)
        return self.now

    def cabinet(self, what: type[Observation], n: int, /, **fields: object) -> None:
        self._tell("cab", what, n, fields)

    def floor(self, what: type[Observation], n: int, /, **fields: object) -> None:
        self._tell("floor", what, n, fields)

    def robot_takes(self, n: int, tag: str, hand) -> None:
        """The cabinet's label goes, then the hand has it."""
        self.cabinet(LabelVanished, n)
        self.tick(0.2)
        hand.grasped(tag, (0.5, 0.4), z=1.0)

    def hand(self, name: str = "hand", town: Town | None = None):
        return (town or self.town).hand(
            f"{self.name}-robot", room=self.name, spool=self.folder / "robot.spool", name=name,
            heartbeat_s=60.0, clock=lambda: self.now.timestamp(),
        )  # fmt: skip

    def sent(self) -> None:
        """All that the hands told is on the server."""
        for running in self.town._agents.values():
            assert running.poster.drain(10.0), running.poster.trouble
            assert running.hands.spool.dead_letters() == []

    def place(self, tag: str):
        """The most probable place, its probability, all of the server's complaints."""
        self.sent()
        top = self.town.objects.get(tag) and self.town.where(tag).top
        assert top is not None
        return top

    def _tell(self, agent: str, what: type[Observation], n: int, fields: dict[str, object]) -> None:
        self._seq[agent] += 1
        name = f"{self.name}-{agent}"
        one = what(seq=self._seq[agent], observed_at=self.tick(0.2), label=f"{name}/{n}", **fields)
        self.town.post(ObservationBatch(agent=name, room=self.name, observations=[one]))


@pytest.fixture
def room(server: ServerProcess, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Room]:
    made = Room(server.url, f"r{abs(hash(request.node.nodeid))}", tmp_path)
    yield made
    made.town.close()


@pytest.fixture
def complaints(room: Room) -> Callable[[], list[str]]:
    return lambda: [f"{one.kind}: {one.detail}" for one in room.town.anomalies(room.name).anomalies]


def test_fetch_and_put_on_the_table(room, complaints):
    tea = room.tags[TEA]
    hand = room.hand()
    room.robot_takes(0, tea, hand)
    top = room.place(tea)
    assert top.kind == "robot" and top.p > 0.99 and top.xy == (0.5, 0.4)
    room.tick()
    hand.moved((3.0, 0.8))
    assert room.place(tea).xy == (3.0, 0.8)
    room.tick()
    hand.released((3.3, 0.5), surface="table/top", z=0.7)
    top = room.place(tea)
    assert (top.kind, top.furniture, top.surface, top.xy) == ("table", "table", "top", (3.3, 0.5)) and top.p > 0.99
    room.tick()
    hand.grasped(tea, (3.3, 0.5))
    top = room.place(tea)
    assert top.kind == "robot" and top.p > 0.99
    room.tick()
    hand.released((3.3, 0.5), surface="table/top")
    room.tick()
    hand.grasped(None, (3.32, 0.5))  # the same place: the same thing
    assert room.place(tea).kind == "robot" and room.place(tea).p > 0.99
    assert hand.held.tag == tea
    assert complaints() == []


def test_what_falls_is_where_the_laser_sees_it(room, complaints):
    tea = room.tags[TEA]
    hand = room.hand()
    room.robot_takes(0, tea, hand)
    room.floor(LabelMoved, 0, xy=(2.0, 2.5))
    room.tick()
    hand.lost((2.0, 2.2))
    room.tick(0.2)
    assert room.place(tea).kind == "mover"
    room.floor(LabelAppeared, 2, kind="floor", xy=(2.0, 2.1), size_m=0.07)
    top = room.place(tea)
    assert top.kind == "floor" and top.p > 0.9 and top.xy == (2.0, 2.1)
    assert complaints() == []


def test_put_back_into_the_smart_cabinet_its_own_sensor_says_where(room, complaints):
    tea = room.tags[TEA]
    hand = room.hand()
    room.robot_takes(0, tea, hand)
    room.tick()
    hand.released((0.3, 0.3), surface="cabinet/board")  # the room knows that it is instrumented
    room.cabinet(LabelAppeared, 20, kind="cabinet", xy=(0.3, 0.3), tag=tea)
    top = room.place(tea)
    assert top.kind == "cabinet" and top.label.endswith("/20") and top.p > 0.99
    assert complaints() == []


def test_given_to_a_person(room):
    tea = room.tags[TEA]
    hand = room.hand()
    room.robot_takes(0, tea, hand)
    room.tick()
    hand.released((1.1, 0.9), kind="person")
    top = room.place(tea)
    assert top.kind == "mover" and top.label.endswith("floor/1") and top.p > 0.99


def test_someone_took_it_from_the_table_and_brought_it_back(room, complaints):
    """What the robot does not know, its next grasp makes good."""
    tea = room.tags[TEA]
    hand = room.hand()
    room.robot_takes(0, tea, hand)
    room.tick()
    hand.released((3.3, 0.5), surface="table/top")
    room.cabinet(LabelAppeared, 21, kind="cabinet", xy=(0.3, 0.3), tag=tea)  # a person put it there
    room.cabinet(TagObserved, 21, tag=tea)
    assert room.place(tea).kind == "cabinet"
    room.cabinet(LabelVanished, 21)  # and took it again
    room.tick()
    hand.grasped(tea, (3.3, 0.5))
    top = room.place(tea)
    assert top.kind == "robot" and top.p > 0.99
    assert complaints() == []


def test_told_before_the_cabinet_noticed_one_more_read_settles_it(room):
    tea = room.tags[TEA]
    hand = room.hand()
    room.tick()
    hand.grasped(tea, (0.5, 0.4))
    room.cabinet(LabelVanished, 0)
    room.tick()
    hand.read(tea)
    top = room.place(tea)
    assert top.kind == "robot" and top.p > 0.99


def test_two_arms_are_two_labels(room, complaints):
    tea, cup = room.tags[TEA], room.tags[CUP]
    left, right = room.hand("left"), room.hand("right")
    room.robot_takes(0, tea, left)
    room.robot_takes(1, cup, right)
    room.tick()
    assert {room.place(tea).label, room.place(cup).label} == {left.held.label, right.held.label}
    left.released((3.3, 0.5), surface="table/top")
    assert room.place(tea).kind == "table" and room.place(cup).kind == "robot"
    assert complaints() == []


def test_the_short_forms(room):
    tea = room.tags[TEA]
    with pytest.raises(TownError, match="no hand 'right' is open"):
        room.town.grasped(tea, at=(0.5, 0.4), hand="right")
    room.hand("right")
    room.cabinet(LabelVanished, 0)
    room.tick()
    room.town.grasped(tea, at=(0.5, 0.4, 1.0), hand="right")
    assert room.place(tea).z == 1.0
    room.tick()
    room.town.released(at=(3.3, 0.5, 0.7), surface="table/top", hand="right")
    assert room.place(tea).z == 0.7 and room.place(tea).kind == "table"


def test_the_robot_restarts_with_a_thing_in_its_hand(room, complaints):
    tea, cup = room.tags[TEA], room.tags[CUP]
    with Town(room.url) as town:
        hand = room.hand(town=town)
        room.robot_takes(0, tea, hand)
        room.tick()
        hand.released((3.3, 0.5), surface="table/top")
        room.tick()
        room.robot_takes(1, cup, hand)
        label = hand.held.label
    room.tick(10)
    again = room.hand()
    assert again.held.label == label and again.held.tag == cup
    assert room.place(cup).label == label and room.place(cup).p > 0.99
    assert room.place(tea).kind == "table" and room.place(tea).p > 0.99
    room.tick()
    again.grasped(tea, (3.3, 0.5))
    assert room.place(tea).kind == "robot"
    assert complaints() == []


def test_a_lost_spool_leaves_nothing_behind(room):
    """The robot's computer was replaced: what its hands held is not for ever in them, and no label comes again."""
    tea = room.tags[TEA]
    with Town(room.url) as town:
        hand = room.hand(town=town)
        room.robot_takes(0, tea, hand)
        old = hand.held.label
    for file in room.folder.iterdir():
        file.unlink()
    room.tick(10)
    hand = room.hand()
    assert hand.held is None
    assert room.place(tea).kind == "mover"
    room.tick()
    hand.grasped(tea, (0.5, 0.4))
    assert hand.held.label != old and room.place(tea).label == hand.held.label


def test_no_server_is_no_trouble(tmp_path, room):
    with Town("http://127.0.0.1:9", retry=Retry(attempts=1)) as away:
        hand = away.hand(f"{room.name}-robot", room=room.name, spool=room.folder / "robot.spool")
        hand.grasped(room.tags[TEA], (0.5, 0.4), when=datetime.now(UTC) + timedelta(seconds=1))
        assert hand.held is not None
    room.now = datetime.now(UTC) + timedelta(seconds=2)
    assert room.hand().held.tag == room.tags[TEA]
    top = room.place(room.tags[TEA])
    assert top.kind == "robot"


def test_errors_change_nothing(room, tmp_path):
    with pytest.raises(NotFound):
        room.town.hand("x", room="nowhere", spool=tmp_path / "x.spool")
    hand = room.hand()
    for bad in ({"tag": "no tag", "xy": (0, 0)}, {"tag": TEA, "xy": (float("nan"), 0)}):
        with pytest.raises(ValueError):
            hand.grasped(**bad)
        assert hand.held is None
    with pytest.raises(TownError, match="works in room"):
        room.town.hand(f"{room.name}-robot", room="elsewhere", spool=tmp_path / "y.spool")
    with Spool(tmp_path / "other.spool", "other") as other, pytest.raises(SpoolError, match="other"):
        room.town.hand("z", room=room.name, spool=other)


def test_a_full_spool_forgets_the_call_not_the_hand(room, tmp_path):
    with Spool(tmp_path / "small.spool", "small", max_items=3) as spool, Town("http://127.0.0.1:9") as away:
        hand = away.hand("small", room=room.name, spool=spool)  # two observations: inventory and state
        hand.grasped(TEA, (0, 0))
        before = hand.held
        with pytest.raises(SpoolError, match="full"):
            hand.released((1, 1))
        assert hand.held == before


async def test_the_same_for_asyncio(room, complaints):
    tea = room.tags[TEA]
    room.cabinet(LabelVanished, 0)
    async with AsyncTown(room.url) as town:
        hand = await town.hand(
            f"{room.name}-robot", room=room.name, spool=room.folder / "robot.spool", name="right",
            clock=lambda: room.now.timestamp(),
        )  # fmt: skip
        room.tick()
        await town.grasped(tea, at=(0.5, 0.4), hand="right")
        await hand.read(tea)
        room.tick()
        await hand.moved((3.0, 0.5), z=0.9)
        await hand.released((3.3, 0.5), surface="table/top")
        assert hand.held is None
        room.tick()
        await hand.grasped(tea, (3.3, 0.5))
        room.tick()
        await hand.lost()
        room.tick()
        await hand.grasped(tea, (3.3, 0.5))
        room.tick()
        await town.released(at=(3.4, 0.6, 0.7), surface="table/top", hand="right")
    top = room.town.where(tea).top
    assert top is not None and top.kind == "table" and top.p > 0.99 and top.xy == (3.4, 0.6)
    assert complaints() == []
