"""Where the objects stood at each visit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tms_agents.slam.geometry import Floats, wrapped
from tms_agents.slam.logs import Log
from tms_agents.slam.semidynamic.candidates import candidates
from tms_agents.slam.semidynamic.choosing import SAME_M, SAME_RAD, Family, Track, choose, complete
from tms_agents.slam.semidynamic.looking import sight_of
from tms_agents.slam.semidynamic.models import Models, ObjectModel
from tms_agents.slam.semidynamic.reads import Rounds
from tms_agents.slam.semidynamic.scoring import Sight
from tms_agents.slam.semidynamic.shapes import Shape, shape_of
from tms_agents.slam.semidynamic.visits import Visit, quiet_visits, visits_of

#: Hinges that are kept, so far apart at least (m), and angles of each at every visit.
_HINGES, _HINGES_APART_M, _ANGLES = 8, 0.1, 6
#: What was not read is where it is said to be if so much was seen of it there (log-odds).
_SEEN = 3.0
#: Hinges (m) and angles (rad) that are nearly the same.
_MOVES_M, _NEARLY = np.linspace(-0.16, 0.16, 9), np.linspace(-0.25, 0.25, 21)
_TURNS = np.linspace(-np.pi, np.pi, 120, endpoint=False)


@dataclass(frozen=True, slots=True, eq=False)
class Stay:
    """An object at ``pose`` (3,) during ``visit``; ``left``: it is not there any more, and nobody saw where it is."""

    visit: Visit
    pose: Floats
    left: bool = False


def solve(
    log: Log, poses: Floats, rounds: Rounds, round_poses: Floats, models: Models, seed: int
) -> dict[str, list[Stay]]:
    """Of every tag that was read, its stays in order of time, at poses of the robot (S, 3) at scans and (R, 3) at
    rounds; of a door also those at which its panel was seen and its tag was not read."""

    def sights_of(visits: Sequence[Visit]) -> list[Sight]:
        return [sight_of(visit, log, poses, rounds, round_poses, models) for visit in visits]

    tracks: dict[str, Track] = {}
    for number, (tag, model) in enumerate(sorted(models.objects.items())):
        visits = visits_of(tag, rounds, round_poses, log.t, poses)
        if not visits:
            continue
        random = np.random.default_rng([seed, number])
        shape = shape_of(model)
        families = (_hinged if model.hinged else _free)(sights_of(visits), model, shape, random)
        tracks[tag] = Track(tag, shape, visits, families)
    choose(tracks, np.random.default_rng([seed, len(tracks)]))
    seen: dict[str, list[Floats]] = {}
    for tag, track in tracks.items():
        quiet = quiet_visits(track.visits, rounds, round_poses, log.t, poses) if models.objects[tag].hinged else []
        if quiet:
            sights = sights_of([*track.visits, *quiet])
            tracks[tag], seen[tag] = _with_quiet(track, quiet, sights, models.objects[tag])
    complete(tracks)
    return {tag: _stays(track, seen.get(tag, [])) for tag, track in tracks.items()}


def _with_quiet(
    track: Track, quiet: Sequence[Visit], sights: Sequence[Sight], model: ObjectModel
) -> tuple[Track, list[Floats]]:
    """``quiet`` visits, too, at any angle about nearly the same hinge: one that was seen closed only is not known well
    along its wall. ``sights`` are of the track's visits and of those. And how much of poses (C,) was seen at those."""
    assert track.chosen is not None
    near = track.chosen[:, 2, None] + _NEARLY
    angles = [*near, *(_TURNS for _ in quiet)]
    moves = np.stack(np.meshgrid(_MOVES_M, _MOVES_M), axis=-1).reshape(-1, 2)
    around = track.chosen[0, :2] + moves[np.argsort(np.hypot(*moves.T), kind="stable")]
    totals = np.zeros(len(around))
    for sight, turns in zip(sights, angles, strict=True):
        turned = np.concatenate([_turned(hinge, turns) for hinge in around])
        totals += sight.score(model, track.shape, turned).reshape(len(around), -1).max(axis=1)
    hinge = around[int(np.argmax(totals))]
    fine = [_turned(hinge, turns) for turns in near]
    free = _family(hinge, sights[len(fine) :], model, track.shape)
    scores = [sight.score(model, track.shape, one) for sight, one in zip(sights[: len(fine)], fine, strict=True)]
    visits, all_poses, all_scores = [*track.visits, *quiet], [*fine, *free.poses], [*scores, *free.scores]
    order = np.argsort([visit.ends for visit in visits], kind="stable")
    family = Family(tuple(all_poses[n] for n in order), tuple(all_scores[n] for n in order))
    seen = [sight.seen(track.shape, poses) for sight, poses in zip(sights[len(fine) :], free.poses, strict=True)]
    return Track(track.tag, track.shape, [visits[n] for n in order], [family]), seen


def _stays(track: Track, seen: Sequence[Floats]) -> list[Stay]:
    """Without quiet visits at which nobody saw it; if it should have been read then where it was last, it has left."""
    assert track.chosen is not None
    found: list[Stay] = []
    quiet = iter(seen)
    for number, (visit, pose) in enumerate(zip(track.visits, track.chosen, strict=True)):
        if not visit.reads:
            which = (track.families[0].poses[number] == pose).all(axis=1)
            if next(quiet)[which].max() < _SEEN:
                if found and not _same(found[-1].pose, pose):
                    found[-1] = replace(found[-1], left=True)
                continue
        found.append(Stay(visit, pose))
    return found


def _same(a: Floats, b: Floats) -> bool:
    return bool(np.hypot(*(a - b)[:2]) < SAME_M and abs(wrapped(a[2] - b[2])) < SAME_RAD)


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
