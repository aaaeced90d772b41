"""Doors whose tag is not read: their panel is seen, or they are not where they were."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tms_agents.simulation.semidynamic_drive import record
from tms_agents.slam import Log, read_log
from tms_agents.slam.geometry import Floats, wrapped
from tms_agents.slam.logs import lines_of_file, odometry_at
from tms_agents.slam.polishing import legs_of
from tms_agents.slam.semidynamic import Models, Rounds, Stay, parse_models, parse_rounds
from tms_agents.slam.semidynamic.drawing import draw
from tms_agents.slam.semidynamic.shapes import surface
from tms_agents.slam.semidynamic.solving import solve
from tms_agents.slam.semidynamic.visits import quiet_visits, visits_of


class World:
    """Two passes with the true path; between them one door was closed (``large``), the other opened (``small``)."""

    def __init__(self, folder: Path) -> None:
        self.log: Log = read_log(folder / "stream.jsonl.gz")
        self.rounds: Rounds = parse_rounds(lines_of_file(folder / "stream.jsonl.gz"))[0]
        self.models: Models = parse_models((folder / "models.json").read_text())
        truth = json.loads((folder / "truth.json").read_text())
        path = np.array(truth["trajectory"])
        self.poses: Floats = odometry_at(path[:, 0], path[:, 1:], self.log.t)
        self.round_poses: Floats = odometry_at(path[:, 0], path[:, 1:], self.rounds.t)
        self.true = {
            tag: np.array([[at["x"], at["y"], at["theta"]] for at in one["poses"]])
            for tag, one in truth["objects"].items()
        }
        self.large, self.small = (
            next(tag for tag, one in truth["objects"].items() if one["class"] == kind)
            for kind in ("door_large", "door_small")
        )

    def deaf(self, tag: str, leg: int) -> Rounds:
        """As if ``tag`` had not been read in that pass."""
        legs = legs_of(self.rounds.t)
        tags = [heard - {tag} if now == leg else heard for heard, now in zip(self.rounds.tags, legs, strict=True)]
        return replace(self.rounds, tags=tuple(tags))

    def solved(self, rounds: Rounds) -> dict[str, list[Stay]]:
        return solve(self.log, self.poses, rounds, self.round_poses, self.models, 0)

    def drawn(self, stays: dict[str, list[Stay]], tag: str, leg: int) -> float:
        """Share of the door's surface in that pass, its ends left out, that is in the map."""
        grid = draw(self.log, self.poses, stays, self.models, 0.02)
        rows, columns = np.nonzero(np.nan_to_num(grid.probabilities()) > 0.65)
        cells = np.array(grid.origin) + (np.stack([columns, rows], axis=-1) + 0.5) * grid.resolution
        panel = surface(self.models.objects[tag], self.true[tag][leg])
        panel = panel[np.hypot(*(panel - self.true[tag][leg, :2]).T) > 0.3]
        return float((cKDTree(cells).query(panel)[0] < 0.03).mean())


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    folder: Path = tmp_path_factory.mktemp("ward")
    record("ward", 1, folder)
    return World(folder)


def test_a_door_that_was_open_and_not_read_is_not_left_open_in_the_map(world: World) -> None:
    stays = world.solved(world.deaf(world.large, 0))
    open_, closed = stays[world.large]
    assert (open_.visit.reads, open_.visit.leg, closed.visit.leg) == (0, 0, 1)
    off = open_.pose - world.true[world.large][0]
    assert np.hypot(*off[:2]) < 0.2
    assert abs(wrapped(off[2])) < np.radians(15)
    assert world.drawn(stays, world.large, 0) < 0.1
    assert world.drawn(stays, world.large, 1) > 0.9


def test_a_door_that_was_opened_and_is_not_read_any_more_is_not_left_closed(world: World) -> None:
    stays = world.solved(world.deaf(world.small, 1))
    last = stays[world.small][-1]
    assert last.left or abs(wrapped(last.pose[2] - world.true[world.small][1, 2])) < np.radians(15)
    assert world.drawn(stays, world.small, 0) < 0.3


def test_what_was_read_stands_where_it_did_without_quiet_visits(world: World) -> None:
    heard = world.solved(world.rounds)
    deaf = world.solved(world.deaf(world.large, 0))
    for tag in set(heard) - {world.large}:
        assert [stay.visit.reads for stay in deaf[tag]] == [stay.visit.reads for stay in heard[tag]]
        apart = [np.hypot(*(a.pose - b.pose)[:2]) for a, b in zip(heard[tag], deaf[tag], strict=True)]
        assert max(apart) < 0.1


def test_quiet_visits_are_all_the_other_times(world: World) -> None:
    rounds = world.deaf(world.large, 0)
    visits = visits_of(world.large, rounds, world.round_poses, world.log.t, world.poses)
    quiet = quiet_visits(visits, rounds, world.round_poses, world.log.t, world.poses)
    assert [visit.reads for visit in quiet] == [0] * len(quiet)
    assert {visit.leg for visit in quiet} == {0}
    assert all(visit.ends < world.log.t[legs_of(world.log.t) == 1][0] + 1e-9 for visit in quiet)
    scans = np.concatenate([visit.scans for visit in (*visits, *quiet)])
    assert len(np.unique(scans)) == len(scans)
    near = np.hypot(*(world.poses[:, :2] - np.mean([visit.middle for visit in visits], axis=0)).T) < 5.9
    assert set(np.flatnonzero(near)) <= set(scans)
    assert quiet_visits(
        visits_of(world.small, world.rounds, world.round_poses, world.log.t, world.poses),
        world.rounds, world.round_poses, world.log.t, world.poses,
    ) == []  # fmt: skip
