"""Work that threads share piece by piece: who is done with its own takes what the others have not begun.

A plain ``prange`` gives every thread one equal run of the loop before it begins. Particles stand in families whose
scans cost alike, and one search may take a hundred times as long as another, so threads would wait for each other at
the end of most loops. Here, too, each thread begins at its own run, whose particles are still in its cache. What a
piece computes depends neither on who does it nor on when.

    line = queue(count)
    for n in prange(count):
        one = take(line, n)
        while one < count:
            work(one)
            one = take(line, one)
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

Queue = NDArray[np.int64]

#: So often a thread looks for work before it sleeps (some 0.1 ms; GNU OpenMP would look sixty times as long). On a
#: computer with other work to do, who waits wide awake keeps the core from whom he waits for. Read when the first loop
#: is run.
_LOOKS = "5000"
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ.setdefault("GOMP_SPINCOUNT", _LOOKS)


def _adding(_: Any, line: Any, place: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        address = builder.gep(array.data, [arguments[1]])
        return builder.atomic_rmw("add", address, context.get_constant(types.int64, 1), "monotonic")

    return types.int64(line, types.int64), generate


#: One more at a place of a queue, atomically; what was there before.
_add = cast(Callable[[Queue, int], int], intrinsic(_adding))


@njit(cache=True)
def queue(count: int) -> Queue:
    """Pieces of which none is taken yet; the last number is how many are."""
    line = np.empty(count + 1, dtype=np.int64)
    line[:] = 0
    return line


@njit(cache=True)
def take(line: Queue, first: int) -> int:
    """The next piece from ``first`` on, and around, that nobody has; their number if there is none."""
    count = len(line) - 1
    if line[count] >= count:
        return count
    for n in range(first, first + count):
        one = n if n < count else n - count
        if line[one] == 0 and _add(line, one) == 0:
            _add(line, count)
            return one
    return count
