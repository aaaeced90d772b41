"""Belief engine: speed against the paper's filter, and distance to the exact posterior.

    python benchmarks/placement.py                     events/s at 10, 100 and 1,000 objects (12 of them in play)
    python benchmarks/placement.py --dense 40:60       dense worlds with these seeds, budget 1,000
    python benchmarks/placement.py --table FOLDER      the table of docs/placement.md (scenarios and expected files)

Events/s are per second of CPU time and count every event of the story, label moves included, with the marginals of the
objects that changed.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

from dense_worlds import DenseWorld

from tms_schemas.scenario import Scenario, read_scenario
from tms_server.placement import DrawKey, Engine, PaperFilter, warm_up
from tms_server.placement.replay import VARIANTS, Filter, replay, scenario_filter

Marginals = dict[str, dict[str, float]]
#: Dense worlds beyond this many exact hypotheses are left out: there is no exact answer to compare with.
MOST = 100_000
FEWEST = 10_000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dense", metavar="FROM:TO", help="seeds of dense worlds")
    parser.add_argument("--table", type=Path, metavar="FOLDER", help="scenarios with their expected files")
    args = parser.parse_args()
    warm_up(print)
    if args.dense:
        first, last = map(int, args.dense.split(":"))
        dense(range(first, last))
    elif args.table:
        table(args.table)
    else:
        speed()


def speed() -> None:
    """Events/s of the engine (budget 1,000) and of PaperFilter (numpy, R = 1,000, one cycle per event), one core."""
    print("| objects | in play | engine events/s | paper's filter events/s | ratio |\n|---|---|---|---|---|")
    for objects in (10, 100, 1000):
        movable = min(objects, 12)
        world = DenseWorld(3, objects=objects, people=3, events=150, in_play=movable)
        story = world.scenario()
        del story["params"]["prune_eps"]
        scenario = read_scenario(json.dumps(story))
        engine = max(_rate(scenario_filter(scenario, "particle"), scenario, 10**6) for _ in range(3))
        paper = _rate(_one_cycle(scenario), scenario, 60 if objects == 1000 else 200)
        print(f"| {objects} | {movable} | {engine:,.0f} | {paper:,.0f} | {engine / paper:.0f} |", flush=True)


def _one_cycle(scenario: Scenario) -> PaperFilter:
    belief = scenario_filter(scenario, "paper", particles=1000)
    assert isinstance(belief, PaperFilter)
    belief.cycles = 1
    return belief


def _rate(belief: Engine | PaperFilter, scenario: Scenario, most: int) -> float:
    events = scenario.events[:most]
    began = time.process_time()
    for i, event in enumerate(events):
        info = belief.apply(event, DrawKey(0, "benchmark", i))
        for name in info.changed:
            belief.marginal(name)
    return len(events) / (time.process_time() - began)


def dense(seeds: range) -> None:
    """Mean total variation to the exact marginals over all (event, object), budget 1,000, three draws per world."""
    print("| world | exact hypotheses (peak) | mean TV | seconds per event |\n|---|---|---|---|")
    means: list[float] = []
    for seed in seeds:
        scenario = read_scenario(json.dumps(DenseWorld(seed).scenario()))
        exact, peak, _ = _run(scenario, None, 0)
        if not FEWEST <= peak <= MOST:
            continue
        tv, seconds = 0.0, 0.0
        for draw in range(3):
            got, _, took = _run(scenario, 1000, draw)
            pairs = [(a[o], b[o]) for a, b in zip(exact, got, strict=True) for o in a]
            tv += sum(distance(a, b) for a, b in pairs) / len(pairs) / 3
            seconds += took / len(scenario.events) / 3
        means.append(tv)
        print(f"| {seed} | {peak:,} | {tv:.5f} | {seconds:.6f} |", flush=True)
    if means:
        print(f"| mean of {len(means)} worlds | | {sum(means) / len(means):.5f} | |")


def _run(scenario: Scenario, budget: int | None, seed: int) -> tuple[list[Marginals], int, float]:
    belief = scenario_filter(scenario, "exact" if budget is None else "particle", particles=budget)
    steps, peak, seconds = [belief.marginals()], 0, 0.0
    for i, event in enumerate(scenario.events):
        began = time.perf_counter()
        info = belief.apply(event, DrawKey(seed, "benchmark", i))
        steps.append({**steps[-1], **{o: belief.marginal(o) for o in info.changed}})
        seconds += time.perf_counter() - began
        peak = max(peak, info.hypotheses)
        if budget is None and peak > MOST:
            break
    return steps, peak, seconds


def table(folder: Path) -> None:
    """Every scenario of the folder, filter and variant against its expected file."""
    print("| scenario | variant | exact | particle 1,000 | particle 30 | paper R = 10,000 |\n|---|---|---|---|---|---|")
    columns: list[tuple[Filter, int | None]] = [
        ("exact", None),
        ("particle", 1000),
        ("particle", 30),
        ("paper", None),
    ]
    for path in sorted(folder.glob("*.expected.json")):
        expected = json.loads(path.read_text(encoding="utf-8"))["variants"]
        scenario = read_scenario(path.with_name(path.name.replace(".expected", "")).read_bytes())
        for variant in VARIANTS:
            cells = []
            for name, particles in columns:
                steps = replay(scenario, name, variant, particles)["steps"]
                cells.append(f"{_mean(expected[variant]['steps'], steps):.2g}")
            print(f"| {scenario.name} | {variant} | {' | '.join(cells)} |", flush=True)


def _mean(expected: list[dict[str, Any]], steps: list[dict[str, Any]]) -> float:
    got = {s["event"]: s["marginals"] for s in steps}
    tv = [distance(pie, got[s["event"]][o]) for s in expected for o, pie in s["marginals"].items()]
    return sum(tv) / len(tv)


def distance(a: dict[str, float], b: dict[str, float]) -> float:
    """Total variation of two distributions over labels."""
    return 0.5 * sum(abs(a.get(k, 0.0) - b.get(k, 0.0)) for k in set(a) | set(b))


if __name__ == "__main__":
    main()
