"""The cyclic garbage collector, set for a process that keeps much and makes few cycles."""

from __future__ import annotations

import gc

#: Of the three generations. With Python's own (700, 10, 10) a busy server spends a third of its time looking at records
#: and hypotheses that are all still needed.
_THRESHOLDS = (20_000, 20, 20)


def tune_garbage_collector() -> None:
    """Leave out what is there already (modules, schemas, routes) and look at the rest more rarely."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_THRESHOLDS)
