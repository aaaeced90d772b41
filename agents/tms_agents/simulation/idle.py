"""After the story: an ordinary afternoon. The person walks about; later, now and then, a thing changes cabinets."""

from __future__ import annotations

import numpy as np

from tms_agents.simulation.room import PERSON, ROBOT
from tms_agents.simulation.script import Script, Told, wait, walk
from tms_agents.simulation.world import InCabinet, World

_FRONTS = {"cabinet-a": "front of A", "cabinet-b": "front of B", "cabinet-c": "front of C"}
#: For so long nothing is carried about, so that what the story ended with can be looked at.
_AS_THE_STORY_LEFT_IT_S = 600.0
_STROLL = ("middle", "north", "bed", "east", "south")


def afternoon(world: World, rng: np.random.Generator) -> Script:
    """Never ends. Starts where the story left the two."""
    yield from walk(world, ROBOT, "table side", "dock")
    here = "front of B"
    started = world.time_s
    while True:
        yield from wait(world, float(rng.uniform(3.0, 8.0)))
        if world.time_s < started + _AS_THE_STORY_LEFT_IT_S or rng.random() < 0.5:
            there = str(rng.choice([spot for spot in _STROLL if spot != here]))
            yield from walk(world, PERSON, here, there)
            here = there
            continue
        tags = sorted(tag for tag, place in world.places.items() if isinstance(place, InCabinet))
        tag = str(rng.choice(tags))
        place = world.places[tag]
        assert isinstance(place, InCabinet)
        there = str(rng.choice([cabinet for cabinet in _FRONTS if world.free_slots(cabinet)]))
        yield from walk(world, PERSON, here, _FRONTS[place.cabinet])
        world.take(PERSON, tag)
        yield Told(or_go_on=True)
        yield from walk(world, PERSON, _FRONTS[place.cabinet], _FRONTS[there])
        world.put(PERSON, tag, there, world.free_slots(there)[0])
        yield Told(or_go_on=True)
        here = _FRONTS[there]
