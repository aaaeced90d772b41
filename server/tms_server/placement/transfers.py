"""Things change hands: a label appears, a label vanishes, a hand-over.

The rule numbers are those of the event format, ``placement-events/1``.
"""

from __future__ import annotations

import math

import numpy as np

from tms_schemas.events import Handover, HandoverPossible, LabelAppeared, LabelVanished
from tms_server.placement import kernels
from tms_server.placement.labels import OUT_SLOT
from tms_server.placement.objects import NO_READER
from tms_server.placement.state import Array, Children
from tms_server.placement.steps import Step, Steps, World, cut

_NO_OBJECTS = np.empty(0, np.int32)


def appeared(world: World, event: LabelAppeared, p_jump: float | None) -> Steps:
    """Somebody put one of the things he holds (or it jumped, or it is nothing): rules 3 to 6."""
    p, labels = world.parameters, world.labels
    labels.check_new(event.label)
    source = None if event.source is None else labels.mover(event.source)
    alpha = p.alpha[event.kind]
    read = world.objects.read_of(event.tag) if event.reader_present else NO_READER
    likelihood = world.objects.likelihoods(read, alpha, event.weight_g, event.size_m)
    phantom = p.p_phantom.get(event.kind, 0.0)
    jump = p.p_jump if p_jump is None else min(max(p_jump, 0.0), 1.0 - phantom)

    candidates, log_kernel, near = _candidates(world, event.xy, source)
    slot = labels.add(event.label, event.kind, event.xy)
    children = _give(
        world,
        candidates,
        log_kernel,
        near,
        dest=np.full(max(len(candidates), 1), slot, np.int32),
        holding=p.mover_choice == "holding",
        u=max(1.0 - phantom - jump, 0.0),
        stay=phantom,
        jump=(jump, slot),
        from_outside=p_jump is not None,
        likelihood=likelihood,
    )
    yield Step(children, ceiling=float(likelihood.max()))


def _candidates(world: World, xy: tuple[float, float], source: int | None) -> tuple[list[int], Array, Array]:
    """Who may have put a thing at ``xy``: slots, log kernels, and 1 inside the gate, 0 outside it, 2 no gate."""
    if source is not None:
        return [source], np.zeros(1), np.ones(1, np.int64)
    p, labels = world.parameters, world.labels
    log_kernel, near = world.log_kernels(labels.movers, xy)
    # A ghost of weight zero (then all are) is nobody.
    if not labels.ghosts or p.ghost_weight == 0.0:
        return list(labels.movers), log_kernel, near
    at = np.array([labels[g].xy for g in labels.ghosts], np.float64)
    d2 = ((at - np.asarray(xy, np.float64)) ** 2).sum(axis=1)
    ghosts = math.log(p.ghost_weight) - d2 / (2.0 * p.sigma_ghost_m**2)
    return (
        [*labels.movers, *labels.ghosts],
        np.concatenate([log_kernel, ghosts]),
        np.concatenate([near, np.full(ghosts.size, 2, np.int64)]),
    )


def _give(
    world: World,
    candidates: list[int],
    log_kernel: Array,
    near: Array,
    *,
    dest: Array,
    holding: bool,
    u: float,
    stay: float,
    likelihood: Array,
    jump: tuple[float, int] = (0.0, -1),
    from_outside: bool = False,
    idle_to_stay: bool = False,
) -> Children:
    belief, (p_jump, new) = world.belief, jump
    return cut(
        kernels.give(
            belief.rows, belief.w, belief.zob, belief.cols, belief.pinned,
            np.array(candidates, np.int32), log_kernel, near, dest, holding, float(u), float(stay), idle_to_stay,
            float(p_jump), world.labels.shelf(), new, from_outside, likelihood,
        )
    )  # fmt: skip


def vanished(world: World, event: LabelVanished) -> Steps:
    """Somebody took what was there, or it is only hidden: rules 5, 7, 8."""
    p, labels, belief = world.parameters, world.labels, world.belief
    slot = labels.exclusive(event.label)
    dest_label = None if event.dest is None else labels.mover(event.dest)
    hidden = 0.0 if dest_label is not None else p.p_occlude.get(labels[slot].kind, 0.0)
    if dest_label is not None:
        dest, p_dest = np.array([dest_label], np.int32), np.ones(1)
    elif labels.movers:
        log_kernel, near = world.log_kernels(labels.movers, labels[slot].xy)
        if near.any():
            log_kernel = np.where(near > 0, log_kernel, -np.inf)
        p_dest = np.exp(log_kernel - log_kernel.max())
        dest, p_dest = np.array(labels.movers, np.int32), (1.0 - hidden) * (p_dest / p_dest.sum())
    else:
        dest, p_dest = np.array([OUT_SLOT], np.int32), np.array([1.0 - hidden])
    likelihood = world.objects.likelihoods(weight_g=event.weight_g)

    possible = yield Step(_spread(world, slot, dest, p_dest, hidden, likelihood), ceiling=float(likelihood.max()))
    if not possible:  # the thing is gone all the same
        yield Step(_spread(world, slot, dest, p_dest, hidden, world.objects.none), counts=False)
    if hidden > 0.0:
        labels.haunt(slot)
    else:
        labels.remove(slot)
    if not p.keep_empty_ghosts:
        for ghost in [g for g in labels.ghosts if not belief.holds(g)]:
            labels.remove(ghost)


def _spread(world: World, slot: int, dest: Array, p_dest: Array, stay: float, likelihood: Array) -> Children:
    belief = world.belief
    here = np.flatnonzero(belief.pinned == slot)
    return cut(
        kernels.spread(
            belief.rows, belief.w, belief.zob, belief.cols,
            slot, -1, int(here[0]) if here.size else -1, slot, dest, p_dest, float(stay), likelihood,
        )
    )  # fmt: skip


def content_read(world: World, slot: int, likelihood: Array) -> Steps:
    """A reading at an exclusive label: every hypothesis times the likelihood of its content."""
    belief = world.belief
    here = np.flatnonzero(belief.pinned == slot)
    ceiling = float(likelihood.max())
    if here.size:
        yield Step(None, factor=float(likelihood[here[0]]), ceiling=ceiling)
    elif not (belief.rows == slot).any():
        yield Step(None, factor=float(likelihood[-1]), ceiling=ceiling)
    else:
        children = _spread(world, slot, _NO_OBJECTS, np.empty(0), 1.0, likelihood)
        yield Step(children, ceiling=ceiling, merge=False)


def handover(world: World, event: Handover) -> Steps:
    """Notice: exactly one thing passed; an empty-handed giver is evidence against the hypothesis."""
    labels = world.labels
    giver, taker = labels.mover(event.from_), labels.mover(event.to)
    read = NO_READER if event.tag is None else world.objects.read_of(event.tag)
    likelihood = world.objects.likelihoods(read, world.parameters.alpha["handover"])
    children = _give(
        world,
        [giver],
        np.zeros(1),
        np.ones(1, np.int64),
        dest=np.array([taker], np.int32),
        holding=False,
        u=1.0,
        stay=0.0,
        likelihood=likelihood,
    )
    yield Step(children, ceiling=float(likelihood.max()))


def handover_possible(world: World, event: HandoverPossible) -> Steps:
    """Two movers met: with p one of them, if he holds something, passed one thing to the other."""
    labels, p = world.labels, world.parameters
    a, b = labels.mover(event.a), labels.mover(event.b)
    chance = p.p_handover if event.p is None else event.p
    if not p.use_handover or a == b or chance == 0.0:
        return
    belief = world.belief
    if not belief.holds(a) and not belief.holds(b):
        return
    yield Step(
        _give(
            world,
            [a, b],
            np.zeros(2),
            np.ones(2, np.int64),
            dest=np.array([b, a], np.int32),
            holding=False,
            u=chance,
            stay=1.0 - chance,
            likelihood=world.objects.none,
            idle_to_stay=True,
        )
    )


def entered_with(world: World, slot: int) -> Steps:
    """Every object at OUT independently came along with ``p_return``."""
    p = world.parameters.p_return
    belief = world.belief
    if p == 0.0:
        return
    dest, p_dest = np.array([slot], np.int32), np.array([p])
    outside = belief.pinned == OUT_SLOT
    outside[belief.cols[(belief.rows == OUT_SLOT).any(axis=0)]] = True
    for i in np.flatnonzero(outside):
        pin = int(i) if belief.pinned[i] == OUT_SLOT else -1
        yield Step(
            cut(
                kernels.spread(
                    belief.rows, belief.w, belief.zob, belief.cols,
                    OUT_SLOT, int(i), pin, OUT_SLOT, dest, p_dest, 1.0 - p, world.objects.none,
                )
            )
        )  # fmt: skip
