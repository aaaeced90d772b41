"""Visits: spans of time in which a tag was read and its object stood still.

Nobody moves things under the robot's eyes (``slam-sd`` section 1): they move while it is parked or far away. So a visit
ends when the robot parks, or has been out of sight of the place, and is all the time that it was near.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats
from tms_agents.slam.polishing import legs_of
from tms_agents.slam.semidynamic.reads import Rounds

#: So far from the middle of the reads the robot is away (m), and so near it may see the object.
_AWAY_M, _NEAR_M = 9.0, 6.0


@dataclass(frozen=True, slots=True, eq=False)
class Visit:
    """``rounds`` (indices of tag rounds) and ``scans`` (indices) from the time of the visit; ``middle`` (2,) m of
    where the robot was when it read; ``leg``: how often the robot was parked before."""

    tag: str
    rounds: NDArray[np.int64]
    scans: NDArray[np.int64]
    middle: Floats
    reads: int
    leg: int


def visits_of(tag: str, rounds: Rounds, round_poses: Floats, scan_t: Floats, scan_poses: Floats) -> list[Visit]:
    """Of ``tag``, in order of time; poses (R, 3) and (S, 3) of the robot at rounds and scans."""
    numbers = np.flatnonzero(rounds.read(tag))
    if not len(numbers):
        return []
    times = np.concatenate([rounds.t, scan_t])
    order = np.argsort(times, kind="stable")
    pass_of = np.empty(len(times), dtype=np.int64)
    pass_of[order] = legs_of(times[order])
    round_pass, scan_pass = pass_of[: len(rounds.t)], pass_of[len(rounds.t) :]
    groups: list[list[int]] = [[int(numbers[0])]]
    for number in numbers[1:]:
        last = groups[-1]
        middle = np.median(round_poses[last, :2], axis=0)
        between = round_poses[last[-1] : number + 1, :2]
        away = float(np.hypot(*(between - middle).T).max())
        if round_pass[number] != round_pass[last[0]] or away > _AWAY_M:
            groups.append([])
        groups[-1].append(int(number))
    return [_visit(tag, group, round_pass, rounds.t, round_poses, scan_pass, scan_t, scan_poses) for group in groups]


def _visit(
    tag: str,
    group: list[int],
    round_pass: NDArray[np.int64],
    round_t: Floats,
    round_poses: Floats,
    scan_pass: NDArray[np.int64],
    scan_t: Floats,
    scan_poses: Floats,
) -> Visit:
    middle = np.median(round_poses[group, :2], axis=0)
    first, last = round_t[group[0]], round_t[group[-1]]

    def kept(t: Floats, poses: Floats, passes: NDArray[np.int64]) -> NDArray[np.int64]:
        apart = np.hypot(*(poses[:, :2] - middle).T)
        away = (apart > _AWAY_M) | (passes != round_pass[group[0]])
        begins = t[away & (t < first)].max(initial=-np.inf)
        ends = t[away & (t > last)].min(initial=np.inf)
        return np.flatnonzero((t > begins) & (t < ends) & (apart < _NEAR_M))

    return Visit(
        tag,
        kept(round_t, round_poses, round_pass),
        kept(scan_t, scan_poses, scan_pass),
        middle,
        len(group),
        int(round_pass[group[0]]),
    )
