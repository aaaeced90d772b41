"""Short visits: people, and now and then a robot, come in, do one thing, and are out again after seconds."""

from __future__ import annotations

from tms_agents.simulation.floor_world.life import Life
from tms_agents.simulation.floor_world.movers import Mover
from tms_agents.simulation.floor_world.stories import arrival, leave, new_thing, pick, put, wander
from tms_agents.simulation.floor_world.tasks import Go, Story, Wait

_SIZES = (0.05, 0.08, 0.12)
#: Share of those whom somebody follows at once, and of robots.
_PAIRS, _ROBOTS = 0.25, 0.15


def visits(life: Life, duration: float, quiet_s: float, robot: tuple[float, float]) -> None:
    """One visitor every quarter of a minute; who comes may meet who goes."""

    def person(me: Mover) -> Story:
        lying = sorted(life.room.things)
        errand = me.rng.random()
        if errand < 0.4 and len(lying) < 6:
            size = float(me.rng.choice(_SIZES))
            yield from put(life, me, new_thing(life, size, f"o{me.id[1:]}"))
        elif errand < 0.7 and lying:
            yield from pick(life, me, lying[me.rng.integers(len(lying))])
        else:
            yield from wander(life, me, life.now + me.rng.uniform(0, 8))
        yield from leave(life, me)

    def machine(me: Mover) -> Story:
        for _ in range(2):
            yield Go(life.random_place(0.5, life.ways(me)), 25)
            yield Wait(me.rng.uniform(1, 8))
        yield from leave(life, me)

    t, count = quiet_s + life.rng.uniform(0, 4), 0
    while t < duration - 25:
        count += 1
        if life.rng.random() < _ROBOTS:
            life.robot(f"r{count}", t, arrival(life), machine, robot)
        else:
            life.person(f"p{count}", t, arrival(life), person)
        t += life.rng.uniform(1.5, 4) if life.rng.random() < _PAIRS else life.rng.uniform(10, 24)
