"""Whatever the order of arrival, the belief is that of the order of observation, bit for bit."""

from __future__ import annotations

import random
import uuid
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

TAGS = ["E1", "E2", "E3"]
# No shrinking: an example is a second of real appends, and its seed says all.
FEW = settings(
    max_examples=12,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
)


class Story:
    """A random valid course of events, told by a cabinet, a floor and a robot whose labels bear the suffix's agents."""

    def __init__(self, seed: int, length: int, at: Any) -> None:
        self._random, self._at, self._now = random.Random(seed), at, 0.0
        self.told: list[tuple[str, dict[str, Any]]] = []
        self._next = {"cab": 0, "floor": 0, "robot": 0}
        self._labels = 0
        self._things: dict[str, str] = {}
        self._movers: list[str] = []
        for _ in range(length):
            self._now += self._random.choice([0.0, 0.1, 0.5])
            self._step()

    def _step(self) -> None:
        pick = self._random.random()
        if pick < 0.2 or not self._movers:
            self._movers.append(label := self._label("floor"))
            self._tell("floor", type="mover_entered", label=label, xy=self._xy())
        elif pick < 0.4:
            self._tell("floor", type="label_moved", label=self._random.choice(self._movers), xy=self._xy())
        elif pick < 0.65 or not self._things:
            agent = self._random.choice(["cab", "floor"])
            self._things[label := self._label(agent)] = agent
            tag = {"tag": self._random.choice([*TAGS, "X9", None])} if self._random.random() < 0.7 else {}
            kind = "cabinet" if agent == "cab" else "floor"
            near = {"source": {"xy": self._xy()}} if self._random.random() < 0.5 else {}
            self._tell(agent, type="label_appeared", label=label, kind=kind, xy=self._xy(), **tag, **near)
        elif pick < 0.8:
            label = self._random.choice(sorted(self._things))
            self._tell(self._things.pop(label), type="label_vanished", label=label)
        elif pick < 0.9:
            label = self._random.choice(sorted(self._things))
            self._tell(self._things[label], type="tag_observed", label=label, tag=self._random.choice(TAGS))
        elif pick < 0.95:
            near = {"from": {"xy": self._xy()}, "to": {"xy": self._xy()}}
            self._tell("robot", type="handover", **near, tag=self._random.choice(TAGS))
        else:
            self._tell("robot", type="pose", label="robot/0", pose=[*self._xy(), 0.5])

    def _label(self, agent: str) -> str:
        self._labels += 1
        return f"{agent}/{self._labels}"

    def _xy(self) -> list[float]:
        return [round(self._random.uniform(0, 8), 2), round(self._random.uniform(0, 6), 2)]

    def _tell(self, agent: str, **event: Any) -> None:
        self.told.append((agent, {"seq": self._next[agent], "observed_at": self._at(self._now), **event}))
        self._next[agent] += 1


def arrivals(story: Story, shuffle: random.Random, suffix: str) -> list[tuple[str, list[dict[str, Any]]]]:
    """The story torn into batches of one agent each, in any order, some of them twice."""
    batches: list[tuple[str, list[dict[str, Any]]]] = []
    for agent in ("cab", "floor", "robot"):
        mine = [event for teller, event in story.told if teller == agent]
        shuffle.shuffle(mine)
        while mine:
            size = shuffle.randint(1, 6)
            batches.append((agent, mine[:size]))
            mine = mine[size:]
    shuffle.shuffle(batches)
    batches += [batch for batch in batches if shuffle.random() < 0.2]
    return [(agent + suffix, _renamed(events, agent, agent + suffix)) for agent, events in batches]


def _renamed(events: list[dict[str, Any]], old: str, new: str) -> list[dict[str, Any]]:
    return [{**event, "label": event["label"].replace(old, new, 1)} if "label" in event else event for event in events]


@FEW
@given(seed=st.integers(0, 2**32), shuffle=st.randoms(use_true_random=False))
async def test_any_order_of_arrival_gives_the_same_belief(lab, at, seed: int, shuffle: random.Random) -> None:
    suffix = uuid.uuid4().hex[:8]
    await lab.room(f"r{suffix}", tags=TAGS, seed=seed)
    for agent, events in arrivals(Story(seed, 40, at), shuffle, suffix):
        await lab.post(agent, *events, room=f"r{suffix}")
        if shuffle.random() < 0.3:
            await lab.belief(f"r{suffix}")
    view = await lab.belief(f"r{suffix}")
    assert view.fold.to_bytes() == (await lab.sequential(f"r{suffix}")).to_bytes()
    for tag in TAGS:
        assert sum(view.marginal(tag).values()) == pytest.approx(1.0, abs=1e-6)


@settings(FEW, max_examples=5)
@given(seed=st.integers(0, 2**32), shuffle=st.randoms(use_true_random=False))
async def test_a_restart_in_between_changes_nothing(open_lab, at, seed: int, shuffle: random.Random) -> None:
    """What comes after the restart is older than stored states: those are of no use, or of use only to older ones."""
    suffix = uuid.uuid4().hex[:8]
    room = f"r{suffix}"
    torn = arrivals(Story(seed, 60, at), shuffle, suffix)
    async with open_lab(snapshot_every=5) as lab:
        await lab.room(room, tags=TAGS, seed=seed)
        for agent, events in torn[: len(torn) // 2]:
            await lab.post(agent, *events, room=room)
            await lab.belief(room)
    async with open_lab(snapshot_every=5) as lab:
        before = (await lab.belief(room)).fold.to_bytes()
        assert before == (await lab.sequential(room)).to_bytes()
        for agent, events in torn[len(torn) // 2 :]:
            await lab.post(agent, *events, room=room)
            await lab.belief(room)
        assert (await lab.belief(room)).fold.to_bytes() == (await lab.sequential(room)).to_bytes()


async def test_held_back_records_are_folded_once_in_order(open_lab, at) -> None:
    async with open_lab(holdback_s=3600.0 * 24 * 365 * 50) as lab:
        await lab.room(tags=["E1"])
        await lab.post(
            "floor", {"seq": 0, "observed_at": at(1), "type": "mover_entered", "label": "floor/1", "xy": [1, 1]}
        )
        assert (await lab.belief()).movers().movers == []
    async with open_lab(holdback_s=0.2) as lab:
        view = await lab.belief()
        assert [mover.label for mover in view.movers().movers] == ["floor/1"]
        assert view.fold.to_bytes() == (await lab.sequential()).to_bytes()
