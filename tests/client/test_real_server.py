"""The library against the real server: every method once, and the errors that posting depends on."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta

import pytest
from server_process import ServerProcess

import tms_client
from tms_client import AsyncTown, Pace, Spool, Town, cli
from tms_schemas.objects import ObjectFields, ProductIn
from tms_schemas.observation import (
    LabelAppeared,
    LabelVanished,
    MoverEntered,
    Observation,
    ObservationBatch,
    RawRead,
)
from tms_schemas.rooms import RoomIn

ZERO = datetime(2026, 11, 1, tzinfo=UTC)
JAN = "4901777018686"
TAG, TWIN, UNKNOWN = "E00401004E17F97A", "E00401004E17F97B", "E004015000000001"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    with ServerProcess(tmp_path_factory.mktemp("server")) as server:
        yield server


@pytest.fixture(scope="module")
def town(server: ServerProcess) -> Iterator[Town]:
    with Town(server.url) as town:
        outline = {"name": "Lab", "outline": [[0, 0], [5, 0], [5, 4], [0, 4]]}
        for room in ("lab", "empty", "live", "posting"):
            town.rooms.put(room, RoomIn.model_validate(outline))
        town.products.put(JAN, ProductIn(name="green tea", weight_g=525))
        town.objects.put(TAG, ObjectFields(name="tea bottle", synonyms=["お茶"], jan=JAN, room="lab"))
        town.objects.put(TWIN, ObjectFields(name="tea bottle lid", room="lab"))
        town.post(
            ObservationBatch(
                agent="cabinet",
                room="lab",
                observations=[
                    LabelAppeared(seq=0, observed_at=ZERO, label="cabinet/1", kind="cabinet", xy=(1, 1), tag=TAG),
                    MoverEntered(seq=1, observed_at=ZERO, label="cabinet/2", xy=(2, 2)),
                    RawRead(seq=2, observed_at=ZERO, zone="shelf", tag=UNKNOWN),
                ],
            )
        )
        yield town


def test_where(town):
    for name in (TAG, "tea bottle", "お茶", "TEA  BOTTLE"):
        answer = town.where(name)
        assert answer.tag == TAG and answer.top is not None and answer.top.label == "cabinet/1"
        assert answer.best is not None and answer.best.xy == (1.0, 1.0)
    with pytest.raises(tms_client.Ambiguous, match="tea bottle lid"):
        town.where("tea bott")
    with pytest.raises(tms_client.NotFound):
        town.where("unicorn")
    before = town.where("tea bottle", at=ZERO - timedelta(days=1))
    assert before.p("cabinet/1") == 0


def test_where_command(town, server, capsys):
    assert cli.main(["where", "tea", "bottle", "--url", server.url]) == 0
    out = capsys.readouterr().out
    assert out.startswith(f"tea bottle ({TAG}) in lab:\n")
    assert "%  in the cabinet at x 1.00 m, y 1.00 m" in out and "was last read 0 s before by cabinet" in out


def test_objects(town):
    assert {one.tag for one in town.objects.search("tea", room="lab", limit=1)} == {TAG, TWIN}
    assert [one.tag for one in town.objects.search(area=(0, 0, 1.5, 1.5), room="lab")] == [TAG]
    assert town.objects.get(TAG).weight_g == 525
    assert town.objects.patch(TWIN, category="cup").category == "cup"
    assert [one.tag for one in town.objects.search(category="cup")] == [TWIN]
    town.objects.put("T9", ObjectFields(name="gone soon"))
    town.objects.delete("T9")
    with pytest.raises(tms_client.NotFound):
        town.objects.get("T9")


def test_products_rooms_agents(town):
    assert town.products.get(JAN).name == "green tea"
    answer = town.products.import_csv("jan,name,weight_g\n4901777018686,green tea,530\n1,bad,1\n")
    assert (answer.stored, len(answer.refused)) == (1, 1)
    assert town.rooms.get("lab").name == "Lab"
    assert {"lab", "empty"} <= {room.id for room in town.rooms.list()}
    assert "cabinet" in {agent.agent for agent in town.agents.list()}
    assert town.agents.get("cabinet").next_seq >= 3


def test_the_belief_of_a_room(town):
    assert {pie.tag for pie in town.placements("lab").objects} == {TAG, TWIN}
    assert [label.label for label in town.labels("lab").labels] == ["cabinet/1"]
    assert [mover.label for mover in town.movers("lab", at=ZERO).movers] == ["cabinet/2"]
    assert town.anomalies("lab").room == "lab"
    with pytest.raises(tms_client.NotFound):
        town.placements("nowhere")


def test_unknown_tags_and_intake(town):
    (seen,) = town.unknown_tags("lab")
    assert (seen.tag, seen.count, seen.agent) == (UNKNOWN, 1, "cabinet")
    done = town.intake(UNKNOWN, name="mystery box", room="lab")
    assert done.created and done.object.name == "mystery box"
    assert list(town.unknown_tags("lab")) == []


def read(tag: str) -> RawRead:
    return RawRead(seq=0, observed_at=ZERO, zone="z", tag=tag)


def spool_of(tmp_path, agent: str) -> Spool:
    return Spool(tmp_path / agent, agent)


def test_one_bad_item_does_not_block_the_spool(town, tmp_path):
    """A label of another agent is refused by the server with the item's number; the rest arrives."""
    foreign = LabelVanished(seq=0, observed_at=ZERO, label="someone-else/1")
    items: list[Observation] = [read("A1"), foreign, read("A2")]
    with spool_of(tmp_path, "mixed") as spool:
        poster = town.poster(spool, "posting")
        poster.post(*items)
        assert poster.drain(10)
        (dead,) = spool.dead_letters()
        assert dead.seq == 1 and "someone-else/1" in dead.body and dead.reason
    assert {tag.tag for tag in town.unknown_tags("posting")} >= {"A1", "A2"}
    assert town.agents.get("mixed").next_seq == 3


def test_a_number_used_for_another_body_is_a_dead_letter(town, tmp_path):
    with spool_of(tmp_path, "twice") as spool:
        town.poster(spool, "posting").post(read("B0"), read("B1"))
        assert town.poster(spool, "posting").drain(10)
    with Spool(tmp_path / "copy", "twice") as old:
        old.continue_at(1)  # an old copy that believes number 1 is still free
        poster = town.poster(old, "posting")
        poster.post(read("B2"), read("B3"))
        assert poster.drain(10)
        assert [dead.seq for dead in old.dead_letters()] == [1]
        assert "B2" in old.dead_letters()[0].body
    assert "B3" in {tag.tag for tag in town.unknown_tags("posting")}


def test_two_agents_under_one_name(town, tmp_path, caplog):
    """Both run on, taking turns as heartbeats do; the one that is refused says so, the server shows it to all."""
    with Spool(tmp_path / "a.spool", "twins") as one, Spool(tmp_path / "b.spool", "twins") as other:
        posters = [town.poster(spool, "posting") for spool in (one, other)]
        for n in range(6):
            place = (float(n % 2), n / 10)
            label = f"twins/{n}"
            posters[n % 2].post(MoverEntered(seq=0, observed_at=ZERO + timedelta(seconds=n), label=label, xy=place))
            assert posters[n % 2].drain(10.0)
        assert one.buried + other.buried > 0
    view = town.agents.get("twins")
    assert view.state == "faulty" and view.why.startswith("does another agent run under this name?")
    assert "numbers of agent twins are taken by other observations" in caplog.text


def test_a_lost_spool_continues(town, tmp_path):
    for n in range(2):
        with Spool(tmp_path / f"lost{n}", "lost") as spool:
            poster = town.poster(spool, "posting")
            poster.post(read(f"C{n}"))
            assert poster.drain(10) and spool.buried == 0
            labels = spool.new_label()
    assert town.agents.get("lost").next_seq == 2
    assert int(labels.partition("/")[2]) > 1_000_000_000_000


async def test_many_observations_awaited(server, town, tmp_path):
    async with AsyncTown(server.url) as awaited:
        with spool_of(tmp_path, "many") as spool:
            poster = awaited.poster(spool, "posting", pace=Pace(batch=200))
            await poster.post(*(read(f"D{n}") for n in range(1000)))
            assert await poster.drain(30)
        assert (await awaited.agents.get("many")).next_seq == 1000


def test_live_frames(town):
    with contextlib.closing(town.live("live")) as frames:
        assert next(frames).type == "snapshot"
        town.post(ObservationBatch(agent="eye", room="live", observations=[read("E1")]))
        event = next(frame for frame in frames if frame.type == "event")
        assert (event.agent, event.seq, event.event["tag"]) == ("eye", 0, "E1")
    again = RawRead(seq=1, observed_at=ZERO, zone="z", tag="E2")
    town.post(ObservationBatch(agent="eye", room="live", observations=[again]))
    with contextlib.closing(town.live("live", cursor=event.cursor)) as frames:
        resumed = next(frame for frame in frames if frame.type != "state")
        assert resumed.type == "event" and resumed.seq == 1


async def test_live_frames_awaited(server, town):
    async with AsyncTown(server.url) as awaited, contextlib.aclosing(awaited.live("empty")) as frames:
        assert (await anext(frames)).type == "snapshot"
    with pytest.raises(tms_client.NotFound):
        next(town.live("nowhere"))
