"""An agent that (re)connects tells all labels it has; whatever the log missed in between is made good."""

from __future__ import annotations

from tms_schemas.events import LabelAppeared, LabelMoved, LabelVanished, MoverEntered, MoverLeft, TagObserved
from tms_schemas.observation import Inventory, InventoryLabel
from tms_server.town.folding import Folding
from tms_server.town.sight import P_UNSEEN


def reconcile(fold: Folding, inventory: Inventory) -> None:
    """Vanished labels, movers, new labels, then reads: the order of one instant."""
    items, agent = {item.label: item for item in inventory.labels}, fold.record.agent
    known = {name: info for name, info in fold.state.labels.items() if info.agent == agent and not info.ghost}

    for name, info in known.items():
        if name not in items:
            fold.fold(MoverLeft(label=name) if info.kind == "mover" else LabelVanished(label=name))
        elif items[name].kind != info.kind:
            fold.note("invalid", f"inventory: label {name} was of kind {info.kind}, not {items[name].kind}")
        elif items[name].xy != info.xy or items[name].z != info.z or items[name].surface != info.surface:
            fold.fold(LabelMoved(label=name, **_place(items[name])))
    new = [item for name, item in items.items() if name not in known]
    for item in new:
        if item.kind == "mover":
            fold.fold(MoverEntered(label=item.label, **_place(item)))
    for item in new:
        if item.kind != "mover":
            read = {} if item.tag is None else {"tag": item.tag}
            appeared = LabelAppeared(label=item.label, kind=item.kind, **_place(item), **read)
            fold.fold(appeared, p_jump=P_UNSEEN)
    for name, info in known.items():
        tag = items[name].tag if name in items else None
        if tag is not None and tag != info.tag:
            fold.fold(TagObserved(label=name, tag=tag))


def _place(item: InventoryLabel) -> dict[str, object]:
    return {"xy": item.xy, "z": item.z, "cov": item.cov, "surface": item.surface}
