"""How long a vector in the plane is, for kernels: `np.hypot` minds overflow, which no room needs, and is slower."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def norm(x: float, y: float) -> float:
    """The length of (x, y)."""
    return float(np.sqrt(x * x + y * y))
