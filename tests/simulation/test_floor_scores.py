"""Our scores of the floor against the laboratory's scorer, against py-motmetrics, and against cases one can count."""

from __future__ import annotations

import importlib.util
import json
import math
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


def loaded(path: Path) -> ModuleType:
    name = path.stem
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec and spec.loader
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


loaded(BENCHMARKS / "floor_scores_objects.py")
scores: Any = loaded(BENCHMARKS / "floor_scores.py")


def guessed(truth: dict[str, Any], rng: np.random.Generator, wrong: float) -> list[dict[str, Any]]:
    """A prediction from the truth: late, astray, with gaps, other ids, false labels; the more ``wrong`` the worse."""
    names: dict[str, int] = {}
    number = iter(range(10_000))
    frames = []
    ghosts: dict[int, tuple[str, float, float]] = {}
    for k, t in enumerate(truth["t"]):
        labels = []
        for mover in truth["movers"]:
            i = k - mover["frames"][0]
            if not 0 <= i < len(mover["x"]) or rng.random() < 0.1 * wrong:
                continue
            if mover["id"] not in names or rng.random() < 0.004 * wrong:
                names[mover["id"]] = next(number)
            x, y = rng.normal((mover["x"][i], mover["y"][i]), 0.1 * wrong)
            labels.append({"id": names[mover["id"]], "attr": "mover", "x": x, "y": y})
        if len(names) > 1 and rng.random() < 0.01 * wrong:
            a, b = rng.choice(list(names), 2, replace=False)
            names[a], names[b] = names[b], names[a]
        for thing in truth["objects"]:
            for s, span in enumerate(thing["spans"]):
                key = f"{thing['id']}/{s}"
                until = (span["t_picked"] or truth["duration"]) + 1.5 * wrong
                if not span["t_placed"] + 1.2 * wrong <= t < until or rng.random() < 0.02 * wrong:
                    continue
                if key not in names or rng.random() < 0.002 * wrong:
                    names[key] = next(number)
                x, y = rng.normal((span["x"], span["y"]), 0.015)
                labels.append({"id": names[key], "attr": "object", "x": x, "y": y})
        if rng.random() < 0.01 * wrong:
            kind = str(rng.choice(["mover", "object"]))
            ghosts[next(number)] = (kind, *rng.uniform(0, 5, 2))
        ghosts = {label: ghost for label, ghost in ghosts.items() if rng.random() < 0.97}
        labels += [{"id": label, "attr": kind, "x": x, "y": y} for label, (kind, x, y) in ghosts.items()]
        frames.append({"t": t, "labels": labels})
    return frames


def same(ours: Any, theirs: dict[str, Any]) -> None:
    mover, thing = theirs["mover"], theirs["object"]
    for name in ("mota", "motp", "idf1", "hota", "gospa"):
        assert getattr(ours.movers, name) == pytest.approx(mover[name.upper()], abs=1e-3), name
    assert ours.movers.switches == mover["IDSW"]
    assert (ours.movers.false, ours.movers.missed, ours.movers.needed) == (mover["FP"], mover["FN"], mover["N"])
    assert (ours.movers.people, ours.movers.labels) == (mover["n_true"], mover["n_labels"])
    objects = ours.objects
    assert len(objects.spans) == thing["eligible"]
    assert [span.thing for span in objects.spans if not span.found] == thing["missed"]
    assert objects.breaks == thing["breaks"]
    assert objects.stale == thing["stale"]
    assert {kind: sum(one.kind == kind for one in objects.false) for kind in thing["false"]} == thing["false"]
    pairs = [
        (objects.recall(), thing["recall"]),
        (objects.precision, thing["precision"]),
        (objects.median("latency_s"), thing["latency"]),
        (objects.median("error_m"), thing["pos_err"]),
        (np.mean(objects.values("coverage")), thing["coverage"]),
        (objects.kept, thing["kept_occluded"]),
        (objects.median("removal_s"), thing["removal_latency"]),
    ]
    for value, expected in pairs:
        assert value == pytest.approx(np.nan if expected is None else expected, abs=1e-3, nan_ok=True)


@pytest.mark.realdata
@pytest.mark.parametrize(("name", "wrong"), [("s1_floor", 0.0), ("s3_leg", 0.3), ("s3_floor", 1.0), ("s6_leg", 1.0)])
def test_our_scores_are_those_of_the_shared_scorer(name: str, wrong: float, shared_data: Path) -> None:
    theirs: Any = loaded(shared_data.parent / "score" / "floor" / "score_floor.py")
    truth = json.loads((shared_data / "floor" / "sim" / f"{name}.json").read_text())
    prediction = guessed(truth, np.random.default_rng(len(name)), wrong)
    same(scores.score(truth, prediction), theirs.score(truth, prediction))


@pytest.mark.filterwarnings("default")  # of the other program
def test_movers_score_as_with_py_motmetrics() -> None:
    motmetrics: Any = pytest.importorskip("motmetrics", reason="install the extra dev")
    truth = strolls(np.random.default_rng(1), people=5, seconds=60.0)
    prediction = guessed(truth, np.random.default_rng(2), 0.6)
    ours = scores.score_movers(truth, prediction)
    judge = motmetrics.MOTAccumulator(auto_id=True)
    for now in scores.instants_of(truth, prediction):
        apart = now.distances()
        judge.update([int(name[1:]) for name in now.names], now.labels, np.where(apart <= scores.GATE_M, apart, np.nan))
    table = motmetrics.metrics.create().compute(judge, metrics=["mota", "motp", "idf1", "num_misses"], name="x")
    theirs = table.loc["x"]
    assert 0.3 < ours.idf1 < 0.9  # neither perfect nor hopeless
    assert ours.motp == pytest.approx(theirs["motp"], abs=2e-3)
    assert ours.missed == pytest.approx(theirs["num_misses"], abs=3)
    # They count a switch also where a label comes back after a gap to its old mover.
    assert ours.mota == pytest.approx(theirs["mota"], abs=0.01)
    # They name movers by all instants within the gate, the shared scorer and we by the matched ones.
    assert ours.idf1 == pytest.approx(theirs["idf1"], abs=0.02)


def test_perfect_labels_score_perfectly_and_none_score_nothing() -> None:
    truth = strolls(np.random.default_rng(3), people=2, seconds=20.0)
    perfect = scores.score(truth, guessed(truth, np.random.default_rng(0), 0.0))
    movers, objects = perfect.movers, perfect.objects
    assert (movers.mota, movers.idf1, movers.switches) == (1.0, 1.0, 0)
    assert movers.motp < 0.06  # at a time of the grid the label may be a scan older than the truth
    assert movers.hota > 0.94
    assert (objects.recall(), objects.precision, objects.breaks) == (1.0, 1.0, 0)
    blind = scores.score(truth, [{"t": t, "labels": []} for t in truth["t"]])
    assert (blind.movers.mota, blind.movers.idf1, blind.movers.hota, blind.objects.recall()) == (0.0, 0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="no frames"):
        scores.score(truth, [])


def test_a_label_kept_while_the_thing_is_hidden_and_too_long_after_it_is_gone() -> None:
    truth = strolls(np.random.default_rng(4), people=0, seconds=40.0)
    (span,) = truth["objects"][0]["spans"]
    span.update(t_picked=25.0, first_clear=26.0, occluded=[[10.0, 20.0]])
    label = {"id": 1, "attr": "object", "x": span["x"] + 0.03, "y": span["y"] - 0.04}
    frames = [{"t": t, "labels": [label] if 4.0 <= t <= 30.0 and not 15 < t <= 20 else []} for t in truth["t"]]
    objects = scores.score(truth, frames).objects
    assert objects.kept == objects.held == pytest.approx(0.5, abs=0.02)
    assert objects.median("latency_s") == pytest.approx(4.0 - span["first_visible"])
    assert objects.median("error_m") == pytest.approx(0.05)
    assert objects.median("removal_s") == pytest.approx(4.0)
    assert objects.stale == 1
    assert not objects.false


def test_what_was_told_while_it_was_hidden_has_been_kept_since() -> None:
    truth = strolls(np.random.default_rng(4), people=0, seconds=40.0)
    (span,) = truth["objects"][0]["spans"]
    span.update(occluded=[[10.0, 20.0]])
    label = {"id": 1, "attr": "object", "x": span["x"], "y": span["y"]}
    objects = scores.score(truth, [{"t": t, "labels": [label] if t > 16.0 else []} for t in truth["t"]]).objects
    assert objects.kept == pytest.approx(0.4, abs=0.02)
    assert objects.held == pytest.approx(1.0)


def test_what_was_hardly_ever_in_sight_counts_neither_way() -> None:
    truth = strolls(np.random.default_rng(4), people=0, seconds=40.0)
    (span,) = truth["objects"][0]["spans"]
    nothing = [{"t": t, "labels": []} for t in truth["t"]]
    label = {"id": 1, "attr": "object", "x": span["x"], "y": span["y"]}
    found = [{"t": t, "labels": [label] if t > 10.0 else []} for t in truth["t"]]
    span["met_s"] = 1.5
    for frames in (nothing, found):
        objects = scores.score(truth, frames).objects
        assert (math.isnan(objects.recall()), len(objects.glimpsed), objects.false) == (True, 1, [])
    span["met_s"] = 2.5
    assert scores.score(truth, nothing).objects.recall() == 0.0


def test_false_objects_are_told_by_what_they_are_made_of() -> None:
    truth = strolls(np.random.default_rng(5), people=1, seconds=30.0)
    truth["furniture"] = [{"w": 0.4, "h": 0.4, "poses": [{"t": 0, "pose": [1, 4, 0]}, {"t": 9.0, "pose": [4, 4, 0]}]}]
    truth["events"].append({"t": 7.0, "type": "furniture", "id": "chair", "t_end": 9.0})
    (walker,) = truth["movers"]
    frames = []
    for k, t in enumerate(truth["t"]):
        places = {1: (4.1, 4.2), 2: (walker["x"][k], walker["y"][k]), 3: (0.3, 0.4)}
        frames.append({"t": t, "labels": [{"id": i, "attr": "object", "x": x, "y": y} for i, (x, y) in places.items()]})
    objects = scores.score(truth, frames).objects
    assert {one.kind: round(one.seconds) for one in objects.false} == {"furniture": 30, "mover": 30, "other": 30}
    assert objects.per_move() == 1.0
    assert objects.per_ten_minutes("other") == pytest.approx(20.0)


def strolls(rng: np.random.Generator, people: int, seconds: float) -> dict[str, Any]:
    """A truth by hand: people walk in circles, one thing lies from the third second on."""
    t = np.arange(0, seconds, 0.1)
    movers = []
    for i in range(people):
        angle = rng.uniform(0, 6) + 0.4 * t * rng.choice([-1, 1])
        x, y = rng.uniform(2, 3) + np.cos(angle), rng.uniform(2, 3) + np.sin(angle)
        hits = {"A": [5] * len(t)}
        movers.append({"id": f"p{i}", "frames": [0, len(t)], "x": list(x), "y": list(y), "hits": hits})
    span = {"x": 4.5, "y": 1.0, "t_placed": 3.0, "t_picked": None, "first_visible": 3.2, "first_clear": None}
    thing = {"id": "o1", "size": 0.08, "spans": [span | {"occluded": []}]}
    region = [[0, 0], [5, 0], [5, 5], [0, 5]]
    return {
        "t": [float(one) for one in t], "duration": seconds, "movers": movers, "objects": [thing],
        "region": region, "furniture": [], "events": [],
    }  # fmt: skip
