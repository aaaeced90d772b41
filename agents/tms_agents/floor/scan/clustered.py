"""One segmented scan, as the kernels take it that ask whose feet it shows."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tms_agents.floor.scan.segmentation import CLUSTER

Array = NDArray[np.float64]

#: No cluster, (1,).
BLANK = np.zeros(1, CLUSTER)


class ClusteredScan(NamedTuple):
    """What a scan whose first beam was measured at ``t`` shows, for kernels.

    ``clusters`` (m,) of `CLUSTER`; ``of`` (m,) the print of each, -1: none; ``marks`` (m, 4) of `brightness.measure`;
    ``prints`` (p,) of `state.PRINT`. ``blank`` is `BLANK`: a kernel cannot have it of its own.
    """

    clusters: Any
    of: NDArray[np.int64]
    marks: Array
    prints: Any
    t: float
    blank: Any = BLANK
