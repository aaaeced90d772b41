"""Visits: spans of time in which a tag was read and its object stood still.

Nobody moves things under the robot's eyes (``slam-sd`` section 1): they move while it is parked or far away. So a visit
ends when the robot parks, or has been out of sight of the place, and is all the time that it was near. Where the robot
passed and read nothing, that was a visit, too: a quiet one.
"""

from __future__ import annotations

from collections.abc import Sequence
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
    where the robot was when it read (quiet: does at other times); ``leg``: how often the robot was parked before;
    ``ends``: when it had been away (s)."""

    tag: str
    rounds: NDArray[np.int64]
    scans: NDArray[np.int64]
    middle: Floats
    reads: int
    leg: int
    ends: float = np.inf


def visits_of(tag: str, rounds: Rounds, round_poses: Floats, scan_t: Floats, scan_poses: Floats) -> list[Visit]:
    """Of ``tag``, in order of time; poses (R, 3) and (S, 3) of the robot at rounds and scans."""
    numbers = np.flatnonzero(rounds.read(tag))
    if not len(numbers):
        return []
    track = _Track(rounds.t, round_poses, scan_t, scan_poses)
    groups: list[list[int]] = [[int(numbers[0])]]
    for number in numbers[1:]:
        last = groups[-1]
        middle = np.median(round_poses[last, :2], axis=0)
        between = round_poses[last[-1] : number + 1, :2]
        away = float(np.hypot(*(between - middle).T).max())
        if track.round_leg[number] != track.round_leg[last[0]] or away > _AWAY_M:
            groups.append([])
        groups[-1].append(int(number))
    return [track.visit(tag, group, np.median(round_poses[group, :2], axis=0), len(group)) for group in groups]


def quiet_visits(
    visits: Sequence[Visit], rounds: Rounds, round_poses: Floats, scan_t: Floats, scan_poses: Floats
) -> list[Visit]:
    """Those at other times than ``visits`` of one tag, whose thing turns but stays in its place."""
    track = _Track(rounds.t, round_poses, scan_t, scan_poses)
    middle = np.mean([visit.middle for visit in visits], axis=0)
    near = np.flatnonzero(np.hypot(*(round_poses[:, :2] - middle).T) < _NEAR_M)
    met, scans = (np.concatenate([getattr(visit, name) for visit in visits]) for name in ("rounds", "scans"))
    found = []
    while len(near := np.setdiff1d(near, met)):
        quiet = track.visit(visits[0].tag, [int(near[0])], middle, 0)
        met = np.concatenate([near[:1], quiet.rounds])
        if len(quiet.scans) and not len(np.intersect1d(quiet.scans, scans)):
            found.append(quiet)
    return found


class _Track:
    """Where the robot was, at ``round_t`` (R,) and ``scan_t`` (S,), and in which leg."""

    def __init__(self, round_t: Floats, round_poses: Floats, scan_t: Floats, scan_poses: Floats) -> None:
        times = np.concatenate([round_t, scan_t])
        order = np.argsort(times, kind="stable")
        legs = np.empty(len(times), dtype=np.int64)
        legs[order] = legs_of(times[order])
        self.round_leg, self.scan_leg = legs[: len(round_t)], legs[len(round_t) :]
        self._round_t, self._round_poses, self._scan_t, self._scan_poses = round_t, round_poses, scan_t, scan_poses

    def visit(self, tag: str, group: list[int], middle: Floats, reads: int) -> Visit:
        """Around ``middle`` (2,) at the time of a ``group`` of rounds."""
        first, last, leg = self._round_t[group[0]], self._round_t[group[-1]], self.round_leg[group[0]]

        def kept(t: Floats, poses: Floats, legs: NDArray[np.int64]) -> tuple[NDArray[np.int64], float]:
            apart = np.hypot(*(poses[:, :2] - middle).T)
            away = (apart > _AWAY_M) | (legs != leg)
            begins = t[away & (t < first)].max(initial=-np.inf)
            ends = t[away & (t > last)].min(initial=np.inf)
            return np.flatnonzero((t > begins) & (t < ends) & (apart < _NEAR_M)), float(ends)

        rounds, _ = kept(self._round_t, self._round_poses, self.round_leg)
        scans, ends = kept(self._scan_t, self._scan_poses, self.scan_leg)
        return Visit(tag, rounds, scans, middle, reads, int(leg), ends)
