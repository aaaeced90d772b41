"""The map as it is at the end: what does not move from all scans, what moves from where it stands.

Beams that ended on an object are left out of the grid and the object is drawn from its pose: so nothing stays behind
where it was, not even where no beam ever passed again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.ndimage import uniform_filter

from tms_agents.slam.geometry import Floats, transform
from tms_agents.slam.gridmap import GridMap, grid_map, render
from tms_agents.slam.keyframes import key_scans
from tms_agents.slam.logs import Log
from tms_agents.slam.occupancy import HIGHEST, UNKNOWN
from tms_agents.slam.semidynamic.evidence import CELL_M, Place, count_beams
from tms_agents.slam.semidynamic.models import Models
from tms_agents.slam.semidynamic.outlines import Outlines
from tms_agents.slam.semidynamic.remains import remains
from tms_agents.slam.semidynamic.shapes import shape_of
from tms_agents.slam.semidynamic.solving import Stay

#: Beams that end so near to an outline (m) are the object's.
_OWN_M = 0.08
#: Scans that are drawn: one every so much (m, rad).
_STEP_M, _STEP_RAD, _REACH_M = 0.1, 0.1, 0.2
#: What was not read any more has gone if so large a share of its outline was seen through by so many beams, and more of
#: it than was met from outside.
_SEEN_THROUGH, _ENOUGH = 0.3, 4


def draw(log: Log, poses: Floats, stays: Mapping[str, Sequence[Stay]], models: Models, resolution: float) -> GridMap:
    """Cells of ``resolution`` m, with the objects where they stood last."""
    scans = key_scans(log, _STEP_M, _STEP_RAD)
    outlines = Outlines(log.t, stays, models)
    points = [_static(log, poses, int(n), outlines) for n in scans]
    grid = grid_map(render(poses[scans], points, log.laser[:2], resolution, _REACH_M), 0)
    cells = grid.cells.copy()
    cells[remains(grid, log, poses, scans, points)] = UNKNOWN
    for tag, found in stays.items():
        shape = shape_of(models.objects[tag])
        outline = transform(found[-1].pose, shape.outline)
        normals = transform(np.array([0.0, 0.0, found[-1].pose[2]]), shape.normals)
        if found[-1].left or _gone(log, poses, found[-1], outline, normals):
            continue
        at = np.floor((outline - np.array(grid.origin)) / resolution).astype(int)
        inside = ((at >= 0) & (at < np.array(cells.shape[::-1]))).all(axis=1)
        cells[at[inside, 1], at[inside, 0]] = HIGHEST
    return GridMap(cells, grid.origin, resolution)


def _static(log: Log, poses: Floats, n: int, outlines: Outlines) -> Floats:
    """Points of scan ``n``, seen from the robot, that are no object's."""
    points = log.points(n)
    kept: Floats = points[~outlines.own(n, transform(poses[n], points), _OWN_M)]
    return kept


def _gone(log: Log, poses: Floats, last: Stay, outline: Floats, normals: Floats) -> bool:
    """Whether beams went later through where it was seen last; what is hidden is still there. Those that met a side of
    the ``outline`` from inside, along its ``normals`` (M, 2), met another thing, or the wall behind it."""
    later = np.flatnonzero(log.t > last.visit.ends)
    if not len(later):
        return False
    place = Place.around(outline, 0.1)
    beams = count_beams(place, log, poses, later)
    x, y = ((outline - place.corner) / CELL_M).astype(int).T
    through = beams.passes[y, x] >= _ENOUGH * (1 + beams.hits[y, x])
    course = np.stack([uniform_filter(beams.course[..., axis], 3)[y, x] for axis in (0, 1)], axis=-1)
    met = ~through & ((course * normals).sum(axis=1) < 0)
    return float(through.mean()) > max(_SEEN_THROUGH, float(met.mean()))
