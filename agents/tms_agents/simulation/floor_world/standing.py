"""People who stand: for half a minute to five, on feet that hardly move; what they put down lies beside them."""

from __future__ import annotations

import math

import numpy as np

from tms_agents.simulation.floor_world.life import Life
from tms_agents.simulation.floor_world.movers import Mover
from tms_agents.simulation.floor_world.room import Thing
from tms_agents.simulation.floor_world.shapes import Material, Xy
from tms_agents.simulation.floor_world.stories import arrival, cross, leave, would_see
from tms_agents.simulation.floor_world.tasks import Do, Face, Go, Story, Wait

#: Shortest and longest stand, and between two shifts of the weight: restless, at ease, like a statue (s).
_STAND_S = (30.0, 300.0)
_SHIFTS_S = ((3.0, 12.0), (20.0, 60.0), (60.0, 200.0), (600.0, 1200.0))
#: Of the way of a swaying body, so much an ankle goes along: it is that much nearer to the floor.
_LEAN = 0.1
_SIZES = (0.05, 0.08, 0.12)


def stand(life: Life, me: Mover, duration: float) -> Story:
    """Stand here and there, alone or in company, half of the time one leg behind the other; put things down."""
    assert me.walker is not None
    me.walker.lean = _LEAN
    while life.now < duration - 60:
        me.walker.shifts_s = _SHIFTS_S[me.rng.integers(len(_SHIFTS_S))]
        company = [other.xy for other in life.others(me) if other.size is None and life.plan.contains(other.xy, 0.5)]
        goal = life.random_place(0.4)
        if company and me.rng.random() < 0.4:
            turn = me.rng.uniform(-math.pi, math.pi)
            near = (company[0][0] + 0.8 * math.cos(turn), company[0][1] + 0.8 * math.sin(turn))
            goal = near if life.plan.contains(near, 0.3) and life.ways(me).is_free(near) else goal
        yield Go(goal)
        yield Face(_look(life, me))
        seconds = math.exp(me.rng.uniform(*np.log(_STAND_S)))
        seconds = min(seconds, duration - 45 - life.now)
        yield Wait(max(2.0, 0.4 * seconds))
        thing = _beside(life, me) if me.rng.random() < 0.6 else None
        if thing is not None:
            yield _put(life, me, thing)
        yield Wait(max(2.0, 0.6 * seconds))
        if thing is not None and me.rng.random() < 0.4:
            yield _pick(life, me, thing)
            yield Wait(me.rng.uniform(1.0, 20.0))
    yield from leave(life, me)


def standing(life: Life, duration: float, quiet_s: float) -> None:
    """Two who stand, and one who walks about and past them."""

    def passer(me: Mover) -> Story:
        yield from cross(life, me, duration - 30, 0.3)
        yield from leave(life, me)

    for i in range(2):
        life.person(f"p{i + 1}", quiet_s + 1 + 6 * i, arrival(life), lambda me: stand(life, me, duration))
    life.person("p3", quiet_s + 40, arrival(life), passer)


def _look(life: Life, me: Mover) -> Xy:
    """Somewhere, or so that for the first laser one leg is right behind the other."""
    laser = next(iter(life.room.mounts.values())).pose
    if me.rng.random() < 0.5:
        return (me.xy[0] - (me.xy[1] - laser[1]), me.xy[1] + (me.xy[0] - laser[0]))
    return life.random_place()


def _beside(life: Life, me: Mover) -> Thing | None:
    """Something within reach, where a laser can see it and nobody stands; None: there is no such place."""
    for _ in range(60):
        turn, gap = me.rng.uniform(-math.pi, math.pi), me.rng.uniform(0.36, 0.5)
        xy = (me.xy[0] + gap * math.cos(turn), me.xy[1] + gap * math.sin(turn))
        free = life.plan.contains(xy, 0.15) and life.tight_ways().is_free(xy)
        alone = all(math.dist(xy, other.xy) > 0.5 for other in life.others(me))
        apart = all(math.dist(xy, other.pose[:2]) > 0.3 for other in life.room.things.values())
        size = float(me.rng.choice(_SIZES))
        material = Material(me.rng.uniform(0.3, 0.8))
        name = f"{me.id}-{len(life.stays) + 1}"
        thing = Thing(id=name, size=size, shape="disc", pose=(*xy, 0.0), material=material)
        if free and alone and apart and would_see(life, thing):
            return thing
    return None


def _put(life: Life, me: Mover, thing: Thing) -> Do:
    return Do(lambda t: life.place(thing, me.id, t))


def _pick(life: Life, me: Mover, thing: Thing) -> Do:
    return Do(lambda t: life.pick(thing.id, me.id, t))
