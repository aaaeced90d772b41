"""What comes into a room unseen: the first read of a thing is believed, and a large catalogue costs nothing."""

from __future__ import annotations

import pytest


def appeared(seq, at, label, **fields):
    return {
        "seq": seq,
        "observed_at": at,
        "type": "label_appeared",
        "label": label,
        "kind": "cabinet",
        "xy": [0.5, 0.5],
    } | fields


def entered(seq, at, label, xy):
    return {"seq": seq, "observed_at": at, "type": "mover_entered", "label": label, "xy": xy}


def read(seq, at, label, tag):
    return {"seq": seq, "observed_at": at, "type": "tag_observed", "label": label, "tag": tag}


@pytest.mark.parametrize("watched", [False, True], ids=["no floor sensor", "a person is there"])
@pytest.mark.parametrize("at_once", [True, False], ids=["tag with the load", "tag a little later"])
async def test_the_first_read_of_a_thing_is_believed(lab, at, watched, at_once):
    await lab.room(tags=[f"T{n}" for n in range(20)])
    if watched:
        await lab.post("floor", entered(1, at(0), "floor/1", [0.6, 0.8]))
    if at_once:
        await lab.post("cab", appeared(1, at(1), "cab/1", tag="T7"))
    else:
        await lab.post("cab", appeared(1, at(1), "cab/1"), read(2, at(2), "cab/1", "T7"))
    view = await lab.belief()
    assert view.marginal("T7")["cab/1"] > 0.95
    assert view.marginal("T8") == {"OUT": 1.0}


async def test_a_thing_that_went_out_may_come_back_unseen(lab, at):
    """A cabinet and no floor sensor: what was taken is outside, what is put in again is believed."""
    await lab.room(tags=["T1", "T2"])
    await lab.post("cab", appeared(1, at(1), "cab/1", tag="T1"), appeared(2, at(2), "cab/2", tag="T2", xy=[0.8, 0.5]))
    await lab.post("cab", {"seq": 3, "observed_at": at(3), "type": "label_vanished", "label": "cab/1"})
    assert (await lab.belief()).marginal("T1")["OUT"] > 0.95
    await lab.post("cab", appeared(4, at(4), "cab/3"), read(5, at(5), "cab/3", "T1"))
    view = await lab.belief()
    assert view.marginal("T1")["cab/3"] > 0.95
    assert view.marginal("T2")["cab/2"] > 0.95


async def test_a_gate_names_who_carries_an_unseen_thing(lab, at):
    """The antenna at the door reads a tag while a person stands there: he brings it."""
    await lab.room(tags=["T1"])
    await lab.post("floor", entered(1, at(0), "floor/1", [5.0, 3.0]))
    await lab.post("gate", {"seq": 1, "observed_at": at(1), "type": "raw_read", "zone": "door", "tag": "T1"})
    assert (await lab.belief()).marginal("T1")["floor/1"] > 0.9


async def test_a_large_catalogue_costs_nothing(lab, at):
    """Thousands of objects that were never here stay out of the engine when people come and go."""
    await lab.room(tags=[f"T{n}" for n in range(300)])
    await lab.post("floor", entered(1, at(0), "floor/1", [5.0, 3.0]))
    await lab.post("cab", appeared(1, at(1), "cab/1", tag="T7"))
    view = await lab.belief()
    assert len(view.fold.engine.objects) == 1
    assert len(view.placements().objects) == 300


async def test_a_label_that_names_an_unregistered_tag_holds_no_tracked_thing(lab, at):
    """What was taken is outside and might come back; the tag that is read says that this is something else."""
    await lab.room(tags=["T1"])
    await lab.post("cab", appeared(1, at(1), "cab/1", tag="T1"))
    await lab.post("cab", {"seq": 2, "observed_at": at(2), "type": "label_vanished", "label": "cab/1"})
    await lab.post("cab", appeared(3, at(3), "cab/2", tag="STRANGE"))
    assert (await lab.belief()).marginal("T1")["OUT"] > 0.94
