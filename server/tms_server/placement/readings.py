"""Readings that move nothing: tags, loads over several labels, corrections by a person."""

from __future__ import annotations

import numpy as np

from tms_schemas.events import Correction, LoadChange, TagMissed, TagObserved
from tms_server.placement import kernels
from tms_server.placement.labels import OUT_SLOT
from tms_server.placement.objects import NOTHING
from tms_server.placement.specs import OUT, InvalidEvent
from tms_server.placement.state import Array, Children
from tms_server.placement.steps import Step, Steps, World, reweighted
from tms_server.placement.transfers import content_read


def tag_observed(world: World, event: TagObserved) -> Steps:
    """A tag was read at a label or somewhere in a zone: rule 9."""
    slots = _target(world, event)
    obj = world.objects.by_tag.get(event.tag)
    if obj is None:
        return
    if event.labels is None and world.labels[slots[0]].kind != "mover":
        yield from content_read(world, slots[0], world.objects.likelihoods(obj, world.alpha(slots[0])))
    else:
        yield from _zone(world, slots, obj, seen=True)


def tag_missed(world: World, event: TagMissed) -> Steps:
    """A reader read nothing, or a zone reader did not see a tag.

    "Nothing" at a mover names no tag, so it says nothing in the zone form that movers are read by.
    """
    slots = _target(world, event)
    if not world.parameters.use_null_reads:
        return
    if event.labels is None and world.labels[slots[0]].kind != "mover":
        yield from content_read(world, slots[0], world.objects.likelihoods(NOTHING, world.alpha(slots[0])))
        return
    obj = None if event.tag is None else world.objects.by_tag.get(event.tag)
    if obj is not None:
        yield from _zone(world, slots, obj, seen=False)


def _target(world: World, event: TagObserved | TagMissed) -> list[int]:
    names = event.labels if event.labels is not None else [event.label]
    return [world.labels.active(name) for name in names]


def _zone(world: World, slots: list[int], obj: int, *, seen: bool) -> Steps:
    """Object-based: the tag is read with p_read * alpha inside the zone, by mistake with (1 - alpha) / NT outside."""
    objects, belief = world.objects, world.belief
    alpha = world.alpha(slots[0])
    inside, outside = float(objects.p_read[obj]) * alpha, (1.0 - alpha) / objects.n_tags
    if not seen:
        inside, outside = 1.0 - inside, 1.0 - outside
    zone = np.zeros(world.labels.n_slots, np.bool_)
    zone[slots] = True
    yield _by_place(world, belief.column(obj), zone, inside, outside)


def _by_place(world: World, at: Array, zone: Array, inside: float, outside: float) -> Step:
    hit = zone[at]
    ceiling = max(inside, outside)
    if hit.all() or not hit.any():
        return Step(None, factor=inside if hit.all() else outside, ceiling=ceiling)
    return Step(reweighted(world.belief, np.where(hit, inside, outside)), ceiling=ceiling, merge=False)


def load_change(world: World, event: LoadChange) -> Steps:
    """One load difference over several labels: N(|w|; sum of the registered weights, summed variances).

    1 / weight_range_g where any of the labels is empty or holds a thing of unregistered weight.
    """
    slots = [world.labels.exclusive(name) for name in event.labels]
    if len(set(slots)) != len(slots):
        raise InvalidEvent("a label is named twice")
    p, objects, belief = world.parameters, world.objects, world.belief
    if not p.use_weight:
        return
    mask = np.zeros(world.labels.n_slots + 1, np.bool_)
    mask[slots] = True
    sure = np.flatnonzero(mask[belief.pinned])
    hit = mask[belief.rows]
    grams = objects.weight_g[sure].sum() + np.where(hit, objects.weight_g[belief.cols], 0.0).sum(axis=1)
    variance = (
        p.weight_sd_g**2
        + (objects.weight_sd[sure] ** 2).sum()
        + np.where(hit, objects.weight_sd[belief.cols] ** 2, 0.0).sum(axis=1)
    )
    full = sure.size + hit.sum(axis=1) == len(slots)
    density = np.exp(-0.5 * (abs(event.weight_g) - grams) ** 2 / variance) / np.sqrt(2 * np.pi * variance)
    factor = np.where(full & ~np.isnan(grams), density, 1.0 / p.weight_range_g)
    ceiling = max(1.0 / p.weight_range_g, 1.0 / float(np.sqrt(2 * np.pi) * p.weight_sd_g))
    yield Step(reweighted(belief, factor), ceiling=ceiling, merge=False)


def correction(world: World, event: Correction) -> Steps:
    """A person says where an object is or is not: factor r or 1 - r.

    Where the model lets things jump (p_jump), the object may also have got there unseen just before: else a person
    could never correct a belief that holds the truth for impossible.
    """
    if event.label != OUT and event.label not in world.labels.states():
        raise InvalidEvent(f"label {event.label!r} is not known")
    slot = world.labels.slot(event.label)
    obj = world.objects.by_tag.get(event.tag)
    if obj is None:
        return
    belief, p = world.belief, world.parameters
    right, wrong = p.p_correction, 1.0 - p.p_correction
    zone = np.zeros(world.labels.n_slots, np.bool_)
    zone[slot] = True
    if not event.present:
        right, wrong = wrong, right
    elif p.p_jump > 0.0:
        yield Step(_jumped(world, obj, slot), merge=True)
    yield _by_place(world, belief.column(obj), zone, right, wrong)


def _jumped(world: World, obj: int, slot: int) -> Children:
    """The object came to the slot unseen with p_jump, wherever there is room for it."""
    belief, labels, p = world.belief, world.labels, world.parameters.p_jump
    if belief.pinned[obj] >= 0:
        belief.unpin(np.array([obj]))
    at = belief.column(obj)
    room = at != slot
    if slot != OUT_SLOT and labels[slot].kind != "mover":
        room &= ~((belief.rows == slot).any(axis=1) | (belief.pinned == slot).any())
    everything = belief.everything()
    come = np.flatnonzero(room).astype(np.int32)
    target = np.full(labels.n_slots, slot, np.int32)
    relabelled = np.zeros_like(belief.zob)
    _, moved = kernels.relabel(np.ascontiguousarray(at[:, None]), relabelled, np.array([obj], np.int32), target)
    return Children(
        np.concatenate([everything.parent, come]),
        np.concatenate([everything.obj, np.full(come.size, obj, np.int32)]),
        np.concatenate([everything.to, np.full(come.size, slot, np.int32)]),
        np.concatenate([np.where(room, belief.w * (1.0 - p), belief.w), belief.w[come] * p]),
        np.concatenate([belief.zob, (belief.zob ^ moved)[come]]),
    )
