"""Movers and whole contents: enter, leave, swapped tracks, relabelled contents."""

from __future__ import annotations

import numpy as np

from tms_schemas.events import MoverEntered, MoverLeft, MoverSwap, Transfer
from tms_server.placement import kernels
from tms_server.placement.labels import OUT_SLOT
from tms_server.placement.specs import InvalidEvent
from tms_server.placement.state import Array, Children
from tms_server.placement.steps import Step, Steps, World
from tms_server.placement.transfers import entered_with


def entered(world: World, event: MoverEntered) -> Steps:
    """A mover came in, perhaps with things from outside."""
    slot = world.labels.add(event.label, "mover", event.xy)
    yield from entered_with(world, slot)


def left(world: World, event: MoverLeft) -> Steps:
    """A mover went out with everything it holds."""
    slot = world.labels.mover(event.label)
    yield from _carry(world, slot, OUT_SLOT)
    world.labels.remove(slot)


def swapped(world: World, event: MoverSwap) -> Steps:
    """With p the tracker exchanged two movers, so each has what the other had."""
    labels, belief, p = world.labels, world.belief, event.p
    a, b = labels.mover(event.a), labels.mover(event.b)
    if not world.parameters.use_swap or a == b or p == 0.0 or not (belief.holds(a) or belief.holds(b)):
        return
    remap = np.arange(labels.n_slots, dtype=np.int32)
    remap[[a, b]] = b, a
    if p == 1.0:
        yield from _relabel(world, remap)
        return
    sure = np.flatnonzero((belief.pinned == a) | (belief.pinned == b))
    if sure.size:
        belief.unpin(sure)
    rows, zob = kernels.relabel(belief.rows, belief.zob, belief.cols, remap)
    both = np.concatenate([belief.rows, rows])
    still = np.full(both.shape[0], -1, np.int32)
    mass = np.concatenate([belief.w * (1.0 - p), belief.w * p])
    parent = np.arange(both.shape[0], dtype=np.int32)
    yield Step(Children(parent, still, still.copy(), mass, np.concatenate([belief.zob, zob])), rows=both, also=sure)


def transferred(world: World, event: Transfer) -> Steps:
    """Everything at ``from`` is now at ``to``, and ``from`` is no more: rule 11."""
    labels, belief = world.labels, world.belief
    slot = labels.active(event.from_)
    if event.from_ == event.to:
        raise InvalidEvent(f"label {event.to!r} cannot be transferred to itself")
    here = (belief.pinned == slot).sum() + (belief.rows == slot).sum(axis=1)
    if event.to in labels.states():
        to = labels.active(event.to)
        if labels[to].kind != "mover" and belief.holds(to):
            raise InvalidEvent(f"label {event.to!r} is occupied")
        if labels[to].kind != "mover" and (here > 1).any():
            raise InvalidEvent(f"label {event.to!r} cannot hold several objects")
        yield from _carry(world, slot, to)
        labels.remove(slot)
        return
    kind = event.kind or labels[slot].kind
    if kind != "mover" and (here > 1).any():
        raise InvalidEvent(f"label {event.to!r} cannot hold several objects")
    labels.rename(slot, event.to, kind, event.xy or labels[slot].xy)
    concerned = np.concatenate([np.flatnonzero(belief.pinned == slot), belief.cols[(belief.rows == slot).any(axis=0)]])
    if concerned.size:
        yield Step(None, also=concerned)


def _carry(world: World, slot: int, to: int) -> Steps:
    """Everything at a slot goes to another one."""
    if world.belief.holds(slot):
        remap = np.arange(world.labels.n_slots, dtype=np.int32)
        remap[slot] = to
        yield from _relabel(world, remap)


def _relabel(world: World, remap: Array) -> Steps:
    belief = world.belief
    # Pinned objects move under every hypothesis alike: their columns, which do not exist, need no change of hash.
    sure = np.flatnonzero((belief.pinned >= 0) & (remap[belief.pinned] != belief.pinned))
    belief.pinned[sure] = remap[belief.pinned[sure]]
    if not (remap[belief.rows] != belief.rows).any():
        yield Step(None, also=sure)
        return
    rows, zob = kernels.relabel(belief.rows, belief.zob, belief.cols, remap)
    children = belief.everything()._replace(zob=zob)
    yield Step(children, rows=rows, also=sure)
