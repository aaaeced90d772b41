"""Public logs, where they are: as good as published, and the metric itself."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from tms_agents.slam import Settings, build_map, read_log
from tms_agents.slam.metric import agreement_with, read_relations

pytestmark = pytest.mark.realdata


def rows(path: Path) -> np.ndarray:
    with gzip.open(path, "rt") as file:
        return np.loadtxt(file, usecols=(0, 1, 2, 3))


def test_the_metric_on_the_published_path(shared_data):
    folder = shared_data / "slam"
    relations = read_relations(folder / "intel.relations.gz")
    published = rows(folder / "intel.corrected.txt.gz")
    found = agreement_with(relations, published, rows(folder / "intel.odom.txt.gz"))
    assert found.translation == pytest.approx(0.057, abs=0.001)


def test_intel_research_lab(shared_data):
    folder = shared_data / "slam"
    log = read_log(folder / "intel.log.gz")
    assert (len(log), log.bad_lines) == (910, 0)
    result = build_map(log, Settings(seed=1))
    trajectory = np.column_stack([log.t, result.poses])
    relations = read_relations(folder / "intel.relations.gz")
    assert agreement_with(relations, trajectory, rows(folder / "intel.odom.txt.gz")).translation < 0.065
