"""What the demo waits for: everything that is in the room was told to a real server, and who is late is named."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

from server_process import ServerProcess

from tms_agents.simulation.catalogue import ITEMS
from tms_agents.simulation.demo import Plan, register
from tms_agents.simulation.hearing import Hearing
from tms_agents.simulation.room import CABINETS, ROBOT, new_world
from tms_agents.simulation.script import Told
from tms_agents.simulation.world import Gripped
from tms_client import Town
from tms_schemas.observation import (
    AgentState,
    Inventory,
    InventoryLabel,
    LabelAppeared,
    LabelVanished,
    LoadChange,
    Observation,
    ObservationBatch,
    TagObserved,
)

MUG = ITEMS[2].tag


class Agents:
    """Posts what agents might say, a second apart."""

    def __init__(self, town: Town) -> None:
        self._town, self._seq, self._at = town, dict[str, int](), datetime.now(UTC) - timedelta(minutes=5)

    def say(self, agent: str, observation: Observation) -> None:
        seq = self._seq[agent] = self._seq.get(agent, -1) + 1
        self._at += timedelta(seconds=1)
        numbered = observation.model_copy(update={"seq": seq, "observed_at": self._at})
        self._town.post(ObservationBatch(agent=agent, room="demo", observations=[numbered]))


def appeared(label: str, kind: str, tag: str | None = None) -> LabelAppeared:
    values = {"seq": 0, "observed_at": datetime.now(UTC), "label": label, "kind": kind, "xy": (0.5, 4.7)}
    return LabelAppeared.model_validate(values | ({} if tag is None else {"tag": tag}))


def test_who_is_late_is_named_until_all_is_told(tmp_path: Path) -> None:
    now, world, seconds = datetime.now(UTC), new_world(), [0.0]
    with ServerProcess(tmp_path) as server, Town(server.url) as town:
        register(town, Plan())
        agents, hearing = Agents(town), Hearing(town, "demo", monotonic=lambda: seconds[0])

        def late(wish: Told | None = None) -> str:
            return hearing.late(world, wish or Told()) or "nobody"

        switched_on = Told(connected=True)
        assert late(switched_on) == "agent cabinet-a has not said anything"
        for cabinet in CABINETS:
            agents.say(cabinet.id, AgentState(seq=0, observed_at=now, state="connected"))
        agents.say("robot", AgentState(seq=0, observed_at=now, state="faulty", why="a wire is loose"))
        assert late(switched_on) == "agent robot is faulty: a wire is loose"
        agents.say("robot", AgentState(seq=0, observed_at=now, state="connected"))
        assert late(switched_on) == "agent floor has told of nobody in the room"
        for agent in ("floor", "robot"):
            body = InventoryLabel(label=f"{agent}/1", kind="mover", xy=(3.0, 2.0))
            agents.say(agent, Inventory(seq=0, observed_at=now, labels=[body]))
        assert late(switched_on) == "the boards learn their empty load"
        seconds[0] = 2.0
        assert late(switched_on) == "nobody"

        world.bring(MUG, "cabinet-a", 1)
        assert late() == "agent cabinet-a is late: it has told of 0 things on its board, there are 1"
        agents.say("cabinet-a", appeared("cabinet-a/1", "cabinet"))
        assert late() == f"agent cabinet-a is late: it has not told of tag {MUG}"
        untagged = Told(unread=frozenset({MUG}))
        assert late(untagged) == "agent cabinet-a is late: it has not told what something weighs"
        agents.say("cabinet-a", LoadChange(seq=0, observed_at=now, labels=["cabinet-a/1"], weight_g=320.0))
        assert late(untagged) == "nobody"
        agents.say("cabinet-a", TagObserved(seq=0, observed_at=now, label="cabinet-a/1", tag=MUG))
        assert late() == "nobody"

        world.places[MUG] = Gripped(ROBOT)
        assert late() == "agent cabinet-a is late: it has told of 1 things on its board, there are 0"
        agents.say("cabinet-a", LabelVanished(seq=0, observed_at=now, label="cabinet-a/1"))
        assert late() == "agent robot is late: it has told of 0 things in the hand, there are 1"
        agents.say("robot", appeared("robot/2", "robot", MUG))
        assert late() == "nobody"
