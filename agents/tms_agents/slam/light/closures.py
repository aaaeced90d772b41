"""Light in loop closing: where along a corridor, or around a round hall, a later visit fits in.

Where geometry leaves a direction open, the light of the cloud is correlated with that of the submap at every place
along it. A revisit holds if its correlation is high there and clearly lower elsewhere; where there are no colours
geometry alone decides as before.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from tms_agents.slam.geometry import Floats, Ints, wrapped
from tms_agents.slam.light.filtering import as_beams
from tms_agents.slam.light.layer import LightMaps, Singles, light_at
from tms_agents.slam.light.matching import match_light
from tms_agents.slam.light.scans import LightScan
from tms_agents.slam.maps import Maps

#: A turn counts as much as so many m of way; a direction is open if it is held so much less than the firmest.
_LEVER_M, _OPEN = 2.0, 0.02
#: Along it: step, and reach at least (m).
_STEP_M, _REACH_M = 0.08, 1.0
#: Light tells if it scatters so many times more than its noise; a place is right above this correlation, if no other
#: one so far away (m) comes so close.
_TELLS, _CORRELATED, _AWAY_M, _RIVAL = 2.5, 0.6, 0.4, 0.12
#: So large a share of the beams has to end where light is known.
_KNOWN = 0.4
_BEAMS, _BEAMS_COARSE = 900, 250


def tells(beams: LightScan) -> bool:
    """Whether there are colours to tell one place from another."""
    return len(beams.light) > 50 and float(np.std(beams.light)) > _TELLS * float(np.median(beams.deviation))


def placed_by_light(
    maps: Maps,
    which: int,
    light: LightMaps,
    cloud: Floats,
    beams: LightScan,
    pose: Floats,
    hessian: Floats,
    window: float,
    temperature: float,
) -> tuple[Floats, Floats] | None:
    """(pose, hessian) where geometry and light agree, from those of geometry alone; None if light contradicts.

    Geometry is map ``which`` of ``maps``; ``cloud`` (M, 2) are the points that geometry was matched with, ``window`` m
    how far it may be along what geometry leaves open.
    """
    if not tells(beams):
        return pose, hessian
    start = _along_the_open(light, beams, pose, hessian, max(window, _REACH_M))
    if start is None:
        return None
    found, curvature, result = start.copy(), np.empty((3, 3)), np.empty(3)
    tiles, rows = light.tiles, as_beams(beams.thinned(_BEAMS))
    match_light(
        maps.distance.directory[which], maps.distance.cells, maps.metres, maps.frame, cloud, tiles.directory[0],
        tiles.cells, light.frame, rows, start, np.diag([1.0, 1.0, 25.0]), 0.1, 1.0, temperature, found, curvature,
        result,
    )  # fmt: skip
    score, known = correlation(tiles.directory[0], tiles.cells, light.frame, rows, found)
    if score < _CORRELATED or known < _KNOWN:
        return None
    return found, curvature


def _along_the_open(light: LightMaps, beams: LightScan, pose: Floats, hessian: Floats, reach: float) -> Floats | None:
    """The pose of the highest correlation along the direction that geometry holds least; None if two are as good."""
    scale = np.array([1.0, 1.0, _LEVER_M])
    values, vectors = np.linalg.eigh(hessian / scale[:, None] / scale[None, :])
    if values[0] > _OPEN * values[-1]:
        return pose
    tiles = light.tiles
    coarse = as_beams(beams.thinned(_BEAMS_COARSE))
    steps = _STEP_M * np.arange(-math.ceil(reach / _STEP_M), math.ceil(reach / _STEP_M) + 1)
    places = np.array([_moved(pose, vectors[:, 0] / scale, s) for s in steps])
    scores = np.array([correlation(tiles.directory[0], tiles.cells, light.frame, coarse, p) for p in places])
    merit = np.where(scores[:, 1] > _KNOWN, scores[:, 0], -1.0)
    best = int(np.argmax(merit))
    rivals = merit[np.abs(steps - steps[best]) > _AWAY_M]
    if merit[best] < 0.8 * _CORRELATED or (len(rivals) and rivals.max() > merit[best] - _RIVAL):
        return None
    place: Floats = places[best]
    return place


def _moved(pose: Floats, direction: Floats, way: float) -> Floats:
    """``pose`` moved on along a twist (3,): straight on, or around the point that the twist turns about."""
    x, y, turn = direction * way
    if abs(turn) < 1e-9:
        straight: Floats = pose + np.array([x, y, 0.0])
        return straight
    cx, cy = -y / turn, x / turn
    c, s = math.cos(turn), math.sin(turn)
    moved: Floats = pose + np.array([cx - c * cx + s * cy, cy - s * cx - c * cy, turn])
    moved[2] = wrapped(moved[2])
    return moved


@njit(cache=True)
def correlation(directory: Ints, cells: Singles, frame: Floats, beams: Floats, pose: Floats) -> tuple[float, float]:
    """(correlation of beams and map, share of the beams whose light is known) at ``pose`` (3,)."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    found = np.empty(3)
    n, a, b, aa, ab, bb = 0, 0.0, 0.0, 0.0, 0.0, 0.0
    for m in range(len(beams)):
        x = (pose[0] + cosine * beams[m, 0] - sine * beams[m, 1] - frame[0]) * frame[2]
        y = (pose[1] + sine * beams[m, 0] + cosine * beams[m, 1] - frame[1]) * frame[2]
        known = light_at(directory, cells, x, y, found)
        if known * beams[m, 5] * beams[m, 5] < 1.0:
            continue
        n += 1
        a += beams[m, 4]
        b += found[0]
        aa += beams[m, 4] * beams[m, 4]
        ab += beams[m, 4] * found[0]
        bb += found[0] * found[0]
    if n < 2:
        return 0.0, 0.0
    both = (aa - a * a / n) * (bb - b * b / n)
    return (ab - a * b / n) / math.sqrt(both) if both > 1e-12 else 0.0, n / len(beams)
