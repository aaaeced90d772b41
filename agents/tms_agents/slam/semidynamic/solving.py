"""Where the objects stood at each visit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tms_agents.slam.geometry import Floats, wrapped
from tms_agents.slam.logs import Log
from tms_agents.slam.semidynamic.candidates import candidates
from tms_agents.slam.semidynamic.choosing import Family, Track, choose
from tms_agents.slam.semidynamic.looking import sight_of
from tms_agents.slam.semidynamic.models import Models, ObjectModel
from tms_agents.slam.semidynamic.reads import Rounds
from tms_agents.slam.semidynamic.scoring import Sight
from tms_agents.slam.semidynamic.shapes import Shape, shape_of
from tms_agents.slam.semidynamic.visits import Visit, visits_of

#: Hinges that are kept, so far apart at least (m), and angles of each at every visit.
_HINGES, _HINGES_APART_M, _ANGLES = 8, 0.1, 6
_TURNS = np.linspace(-np.pi, np.pi, 120, endpoint=False)


@dataclass(frozen=True, slots=True, eq=False)
class Stay:
    """An object at ``pose`` (3,) during ``visit``."""

    visit: Visit
    pose: Floats


def solve(
    log: Log, poses: Floats, rounds: Rounds, round_poses: Floats, models: Models, seed: int
) -> dict[str, list[Stay]]:
    """Of every tag that was read, its stays in order of time, at poses of the robot (S, 3) at scans and (R, 3) at
    rounds."""
    tracks: dict[str, Track] = {}
    for number, (tag, model) in enumerate(sorted(models.objects.items())):
        visits = visits_of(tag, rounds, round_poses, log.t, poses)
        if not visits:
            continue
        sights = [sight_of(visit, log, poses, rounds, round_poses, models) for visit in visits]
        random = np.random.default_rng([seed, number])
        shape = shape_of(model)
        families = (_hinged if model.hinged else _free)(sights, model, shape, random)
        tracks[tag] = Track(tag, shape, visits, families)
    choose(tracks, np.random.default_rng([seed, len(tracks)]))
    return {
        tag: [Stay(visit, pose) for visit, pose in zip(track.visits, _chosen(track), strict=True)]
        for tag, track in tracks.items()
    }


def _chosen(track: Track) -> Floats:
    assert track.chosen is not None
    return track.chosen


def _free(sights: Sequence[Sight], model: ObjectModel, shape: Shape, random: np.random.Generator) -> list[Family]:
    """What is a candidate at one visit is one at all."""
    every = np.concatenate([candidates(sight, model, shape, random)[0] for sight in sights])
    return [Family(tuple(every for _ in sights), tuple(sight.score(model, shape, every) for sight in sights))]


def _hinged(sights: Sequence[Sight], model: ObjectModel, shape: Shape, random: np.random.Generator) -> list[Family]:
    """All visits together: the hinge stays where it is, only the angle changes."""
    found = [candidates(sight, model, shape, random)[0] for sight in sights]
    hinges, totals = _rated(np.concatenate(found)[:, :2], sights, model, shape)
    kept: list[Floats] = []
    for one in np.argsort(-totals, kind="stable"):
        if len(kept) < _HINGES and all(np.hypot(*(hinges[one] - other)) > _HINGES_APART_M for other in kept):
            kept.append(hinges[one])
    return [_family(_settled(hinge, sights, model, shape), sights, model, shape) for hinge in kept]


def _settled(hinge: Floats, sights: Sequence[Sight], model: ObjectModel, shape: Shape) -> Floats:
    for step in (0.04, 0.02, 0.01):
        moves = np.array([(x, y) for x in (0, -1, 1) for y in (0, -1, 1)], dtype=np.float64) * step
        around, totals = _rated(hinge + moves, sights, model, shape)
        hinge = around[int(np.argmax(totals))]
    return hinge


def _family(hinge: Floats, sights: Sequence[Sight], model: ObjectModel, shape: Shape) -> Family:
    poses, scores = [], []
    for sight in sights:
        rough = sight.score(model, shape, _turned(hinge, _TURNS))
        best = _TURNS[np.argsort(-rough, kind="stable")[: 2 * _ANGLES]]
        fine = np.unique(np.concatenate([one + np.linspace(-0.05, 0.05, 11) for one in best]))
        poses.append(_turned(hinge, fine))
        scores.append(sight.score(model, shape, poses[-1]))
    return Family(tuple(poses), tuple(scores))


def _rated(hinges: Floats, sights: Sequence[Sight], model: ObjectModel, shape: Shape) -> tuple[Floats, Floats]:
    """Hinges (H, 2) and their scores (H,) with the best angle at each visit."""
    poses = np.concatenate([_turned(one, _TURNS) for one in hinges])
    totals = np.zeros(len(hinges))
    for sight in sights:
        totals += sight.score(model, shape, poses).reshape(len(hinges), -1).max(axis=1)
    return hinges, totals


def _turned(hinge: Floats, angles: Floats) -> Floats:
    return np.column_stack([np.broadcast_to(hinge, (len(angles), 2)), wrapped(angles)])
