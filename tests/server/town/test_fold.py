"""What each observation means for a room: labels, movers, reads, and what does not fit."""

from __future__ import annotations

from typing import Any

import pytest

from tms_server.log.bodies import ObjectChanged, ObjectRegistered, ObjectRemoved

PERSON = {"type": "mover_entered", "label": "floor/1", "xy": [1.0, 1.0]}
THING = {"type": "label_appeared", "label": "cab/1", "kind": "cabinet", "xy": [0.5, 0.5], "tag": "E1"}


class Teller:
    """Numbers and dates what agents tell, one second apart."""

    def __init__(self, lab: Any, at: Any) -> None:
        self._lab, self._at, self._seconds = lab, at, 0
        self._next: dict[str, int] = {}

    async def __call__(self, agent: str, **event: Any) -> None:
        self._seconds += 1
        seq = self._next[agent] = self._next.get(agent, -1) + 1
        event = {name.rstrip("_"): value for name, value in event.items()}
        await self._lab.post(agent, {"seq": seq, "observed_at": self._at(self._seconds), **event})


@pytest.fixture
async def tell(lab, at) -> Teller:
    """The lab has two tracked objects, E1 and E2, and a person at (1, 1)."""
    await lab.room(tags=["E1", "E2"])
    teller = Teller(lab, at)
    await teller("floor", **PERSON)
    return teller


async def p(lab: Any, tag: str, label: str) -> float:
    return float((await lab.belief()).marginal(tag).get(label, 0.0))


async def anomalies(lab: Any) -> list[str]:
    return [anomaly.kind for anomaly in (await lab.belief()).anomalies().anomalies]


async def test_a_thing_is_taken_and_put_elsewhere(lab, tell) -> None:
    await tell("cab", **THING)
    assert await p(lab, "E1", "cab/1") > 0.95
    await tell("cab", type="label_vanished", label="cab/1")
    assert await p(lab, "E1", "floor/1") > 0.95
    await tell("floor", type="label_appeared", label="floor/2", kind="floor", xy=[1.2, 1.0])
    assert await p(lab, "E1", "floor/2") > 0.9
    assert await anomalies(lab) == []


async def test_who_turns_out_to_be_another_has_what_he_took(lab, tell) -> None:
    await tell("floor", **{**THING, "label": "floor/3", "kind": "floor"})
    await tell("floor", type="mover_entered", label="floor/2", xy=[0.5, 0.6])
    await tell("floor", type="label_vanished", label="floor/3", dest="floor/2")
    assert await p(lab, "E1", "floor/2") > 0.95
    await tell("floor", type="transfer", from_="floor/2", to="floor/1")
    assert await p(lab, "E1", "floor/1") > 0.95
    assert [mover.label for mover in (await lab.belief()).movers().movers] == ["floor/1"]
    assert await anomalies(lab) == []


async def test_labels_lie_on_furniture(lab, tell) -> None:
    await tell("cab", **THING)
    await tell("cab", **{**THING, "label": "cab/2", "tag": "E2", "surface": "desk/top", "xy": [0.6, 0.5]})
    labels = {label.label: label for label in (await lab.belief()).labels().labels}
    assert (labels["cab/1"].furniture, labels["cab/1"].surface) == ("cabinet", "shelf")
    assert (labels["cab/2"].furniture, labels["cab/2"].surface) == ("desk", "top")
    assert labels["cab/1"].contents["E1"] > 0.9


async def test_labels_tell_what_was_weighed_there(lab, tell) -> None:
    async def weights() -> dict[str, float | None]:
        return {one.label: one.weight_g for one in (await lab.belief()).labels().labels}

    await tell("cab", **THING)
    await tell("cab", **{**THING, "label": "cab/2", "tag": "E2", "weight_g": 250.0})
    assert await weights() == {"cab/1": None, "cab/2": 250.0}
    await tell("cab", type="load_change", labels=["cab/1"], weight_g=320.0)
    await tell("cab", type="load_change", labels=["cab/1", "cab/2"], weight_g=-570.0)
    assert await weights() == {"cab/1": 320.0, "cab/2": 250.0}


async def test_a_mover_given_by_position_is_the_nearest(lab, tell) -> None:
    await tell("floor", type="mover_entered", label="floor/2", xy=[3.0, 1.0])
    await tell("cab", **THING)
    await tell("cab", type="label_vanished", label="cab/1", dest={"xy": [2.6, 1.0]})
    assert await p(lab, "E1", "floor/2") > 0.95
    await tell("robot", type="handover", from_={"xy": [3.0, 1.0]}, to={"xy": [2.9, 1.0]}, tag="E1")
    assert "unknown_mover" in await anomalies(lab)
    await tell("floor", type="label_moved", label="floor/1", xy=[2.0, 1.0])
    await tell("robot", type="handover", from_={"xy": [3.0, 1.0]}, to={"xy": [2.9, 1.0]}, tag="E1")
    assert await p(lab, "E1", "floor/1") > 0.95


async def test_a_robot_grips_and_puts_down(lab, tell) -> None:
    await tell("robot", type="pose", label="robot/body", pose=[1.0, 1.2, 0.5])
    await tell("cab", **THING)
    await tell("cab", type="label_vanished", label="cab/1", dest={"xy": [1.0, 1.3]})
    grip = {"label": "robot/grip1", "kind": "robot", "xy": [1.0, 1.5], "tag": "E1", "source": "robot/body"}
    await tell("robot", type="label_appeared", **grip)
    view = await lab.belief()
    robot = next(mover for mover in view.movers().movers if mover.label == "robot/body")
    assert (robot.theta, robot.expected_objects > 0.95, robot.holds["E1"] > 0.95) == (0.5, True, True)
    await tell("robot", type="transfer", from_="robot/grip1", to="robot/table1", kind="table", xy=[5.0, 5.0])
    labels = {label.label: label for label in (await lab.belief()).labels().labels}
    assert "robot/grip1" not in labels
    assert labels["robot/table1"].put_by_robot
    assert await p(lab, "E1", "robot/table1") > 0.95


async def test_a_zone_read_is_expanded_to_the_labels_in_it(lab, tell) -> None:
    await tell("floor", type="mover_entered", label="floor/2", xy=[5.0, 1.0])
    await tell("cab", **THING)
    await tell("floor", type="label_moved", label="floor/1", xy=[2.5, 0.5])
    await tell("floor", type="label_moved", label="floor/2", xy=[2.5, 0.6])
    await tell("cab", type="label_vanished", label="cab/1")
    assert 0.3 < await p(lab, "E1", "floor/2") < 0.7
    await tell("floor", type="label_moved", label="floor/2", xy=[5.0, 1.0])
    await tell("gate", type="raw_read", zone="door", tag=None)
    assert await p(lab, "E1", "floor/1") > 0.85
    await tell("gate", type="raw_read", zone="door", tag="E1")
    assert await p(lab, "E1", "floor/2") > 0.5
    await tell("gate", type="raw_read", zone="window", tag="E1")
    assert await anomalies(lab) == ["unknown_zone"]


async def test_an_inventory_makes_good_what_was_missed(lab, tell) -> None:
    await tell("cab", **THING)
    await tell("cab", **{**THING, "label": "cab/2", "xy": [0.7, 0.5], "tag": "E2"})
    listed = [
        {"label": "cab/2", "kind": "cabinet", "xy": [0.8, 0.5], "tag": "E2"},
        {"label": "cab/3", "kind": "cabinet", "xy": [0.2, 0.2], "tag": "E1"},
        {"label": "cab/door", "kind": "mover", "xy": [0.0, 0.0]},
    ]
    before = (await lab.belief()).marginal("E2")
    await tell("cab", type="inventory", labels=listed)
    view = await lab.belief()
    assert {label.label: label.xy for label in view.labels().labels} == {"cab/2": (0.8, 0.5), "cab/3": (0.2, 0.2)}
    assert {mover.label for mover in view.movers().movers} == {"floor/1", "cab/door"}
    assert await p(lab, "E1", "cab/3") > 0.9
    assert view.marginal("E2")["cab/2"] == pytest.approx(before["cab/2"], abs=0.05)
    again = view.fold.engine.to_bytes()
    await tell("cab", type="inventory", labels=listed)
    assert (await lab.belief()).fold.engine.to_bytes() == again


async def test_what_does_not_fit_is_an_anomaly_and_changes_nothing(lab, tell) -> None:
    await tell("cab", **THING)
    before = (await lab.belief()).fold.engine.to_bytes()
    await tell("cab", **THING)
    await tell("cab", type="label_moved", label="cab/99", xy=[1, 1])
    await tell("cab", type="tag_observed", label="cab/99", tag="E1")
    await tell("floor", type="mover_left", label="floor/99")
    await tell("floor", type="label_vanished", label="floor/1")
    await tell("robot", type="handover_possible", a={"xy": [7, 5]}, b={"xy": [1, 1]})
    await tell("cab", type="correction", tag="E1", label="cab/99")
    found = await lab.belief()
    assert found.fold.engine.to_bytes() == before
    assert len(found.anomalies().anomalies) == 7
    await tell("cab", type="label_moved", label="cab/99", xy=[1, 1])
    repeated = (await lab.belief()).anomalies().anomalies
    assert (len(repeated), repeated[-1].seq, repeated[-1].agent) == (7, 5, "cab")


async def test_a_label_nobody_announced_is_an_anomaly_after_the_patience(open_lab, at) -> None:
    async with open_lab(patience_s=1e9) as lab:
        await lab.room()
        await lab.post("cab", {"seq": 1, "observed_at": at(5), "type": "label_vanished", "label": "cab/1"})
        assert (await lab.belief()).anomalies().anomalies == []
    async with open_lab(patience_s=0.0) as lab:
        assert [a.kind for a in (await lab.belief()).anomalies().anomalies] == ["unknown_label"]
        await lab.post("cab", {"seq": 0, "observed_at": at(4), **THING})
        assert (await lab.belief()).anomalies().anomalies == []
        assert (await lab.belief()).labels().labels == []


async def test_impossible_evidence_is_told_and_the_belief_kept(lab, tell) -> None:
    """Where nothing is left to chance, a thing that is in one box for certain cannot appear in another."""
    certain = {"p_jump": 0.0, "p_phantom": {"floor": 0.0, "cabinet": 0.0}, "p_return": 0.0, "alpha": {"cabinet": 1.0}}
    await lab.room("strict", tags=["E1"], params=certain)
    box = {"type": "label_appeared", "kind": "cabinet", "xy": [1, 1], "tag": "E1"}
    told = [
        {**box, "label": "box/1"},
        {"type": "mover_entered", "label": "box/2", "xy": [1, 1]},
        {**box, "label": "box/3"},
    ]
    now = "2026-05-01T10:00:00Z"
    await lab.post("box", *({"seq": n, "observed_at": now, **event} for n, event in enumerate(told)), room="strict")
    view = await lab.belief("strict")
    assert [anomaly.kind for anomaly in view.anomalies().anomalies] == ["contradiction"]
    assert view.marginal("E1") == {"box/1": 1.0}


async def test_objects_come_change_and_go(lab, tell) -> None:
    await tell("cab", **THING)
    await lab.registry(ObjectRegistered(tag="E3", name="third"))
    assert (await lab.belief()).marginal("E3")["OUT"] > 0.999
    await lab.registry(ObjectChanged(tag="E3", name="new name", weight_g=5.0))
    assert (await lab.belief()).placement("E3").name == "new name"
    await lab.registry(ObjectRemoved(tag="E1"))
    view = await lab.belief()
    assert view.tags == ["E2", "E3"]
    assert view.fold.to_bytes() == (await lab.sequential()).to_bytes()
