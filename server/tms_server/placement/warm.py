"""Compiling the kernels ahead of the first event, and saying so."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from tms_schemas.events import (
    Event,
    HandoverPossible,
    LabelAppeared,
    LabelVanished,
    MoverEntered,
    MoverLeft,
    MoverSwap,
    TagObserved,
)
from tms_server.placement import kernels
from tms_server.placement.engine import Engine
from tms_server.placement.parameters import Parameters
from tms_server.placement.specs import DrawKey, ObjectSpec


def compiled_before() -> bool:
    """Whether the kernels of this source are in numba's cache (``NUMBA_CACHE_DIR``, else beside the module)."""
    source = Path(kernels.__file__)
    cache = os.environ.get("NUMBA_CACHE_DIR")
    root = Path(cache) if cache else source.parent / "__pycache__"
    newest = max((f.stat().st_mtime for f in root.rglob(f"{source.stem}.give-*.nbi")), default=0.0)
    return newest >= source.stat().st_mtime


def warm_up(say: Callable[[str], None] = lambda message: None) -> None:
    """Load every kernel, compiling those that are not in the cache; ``say`` is told only if that takes time."""
    if not compiled_before():
        say("compiling the belief engine's kernels (once, some 15 s) ...")
    parameters = Parameters.of({"p_return": 0.5, "p_jump": 0.01}, profile="live")
    objects = [ObjectSpec(id=name, tag=name, weight_g=100.0, size_m=0.1) for name in "ABC"]
    engine = Engine(objects, [], {"type": "known"}, parameters, budget=2)
    events: tuple[Event, ...] = (
        MoverEntered(label="P", xy=(0.0, 0.0)),
        MoverEntered(label="Q", xy=(1.0, 0.0)),
        LabelAppeared(label="L", kind="floor", xy=(0.0, 1.0), tag="A", weight_g=90.0, size_m=0.1),
        TagObserved(label="L", tag="B"),
        HandoverPossible(a="P", b="Q"),
        MoverSwap(a="P", b="Q", p=0.5),
        LabelVanished(label="L"),
        MoverLeft(label="P"),
    )
    for seq, event in enumerate(events):
        engine.apply(event, DrawKey(0, "warm-up", seq))
        engine.marginals()
