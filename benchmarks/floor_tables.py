"""The tables of the benchmark of floor sensing, as markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from floor_scores import Floats, Scores
from floor_scores_objects import ObjectScores

#: (scene, feet, contestant) -> scores of each seed.
Table = Mapping[tuple[str, str, str], Sequence[Scores]]
#: Long enough to tell a thing from somebody who stands there or a robot behind him.
CLEAR_S = 20.0


def movers_table(table: Table) -> str:
    head = ("scene", "feet", "by", "IDF1", "worst", "HOTA", "MOTA", "MOTP m", "switches", "labels / people")
    rows = []
    for (scene, feet, name), scores in table.items():
        movers = [one.movers for one in scores]
        if not any(one.people for one in movers):
            continue
        rows.append(
            (
                scene,
                feet,
                name,
                spread([one.idf1 for one in movers]),
                f"{min(one.idf1 for one in movers):.2f}",
                spread([one.hota for one in movers]),
                spread([one.mota for one in movers]),
                spread([one.motp for one in movers]),
                spread([one.switches for one in movers], 1),
                f"{sum(one.labels for one in movers)} / {sum(one.people for one in movers)}",
            )
        )
    return _markdown(head, rows)


def objects_table(table: Table) -> str:
    head = (
        *("scene", "feet", "by", "things", "recall 3 cm", "5", "8 to 13", "15", "kept hidden", "s hidden", "breaks"),
        *("latency s", "removal s: median, p95", "error mm: median, p95", "false / 10 min", "of furniture / move"),
    )
    rows = []
    for (scene, feet, name), scores in table.items():
        all_of = added(one.objects for one in scores)
        each = [one.objects for one in scores]
        rows.append(
            (
                scene,
                feet,
                name,
                str(len(all_of.needed())),
                number(all_of.recall(0.0, 0.04)),
                number(all_of.recall(0.04, 0.07)),
                number(all_of.recall(0.07, 0.14)),
                number(all_of.recall(0.14, 9.0)),
                number(all_of.kept, 3),
                f"{sum(span.hidden_s for span in all_of.spans):.0f}",
                str(all_of.breaks),
                number(all_of.median("latency_s"), 1),
                _quantiles(all_of.values("removal_s"), 1),
                _quantiles(1e3 * all_of.values("error_m"), 0),
                spread([one.per_ten_minutes() for one in each], 1),
                number(all_of.per_move()),
            )
        )
    return _markdown(head, rows)


def requirements_table(every: Mapping[tuple[str, str, str], Sequence[Scores]]) -> str:
    """(kind of seeds, scene, feet) -> scores of ours, against what is asked for."""
    kinds = list(dict.fromkeys((kind, feet) for kind, _, feet in every))
    head = ("asked for", *(f"{kind}, {feet}" for kind, feet in kinds))
    rows: list[tuple[str, ...]] = []

    def row(title: str, scenes: Sequence[str] | None, value: str) -> None:
        cells = []
        for kind, feet in kinds:
            chosen = [s for (k, scene, f), found in every.items() if (k, f) == (kind, feet) for s in found
                      if scenes is None or scene in scenes]  # fmt: skip
            cells.append(_asked(value, chosen) if chosen else "")
        if any(cells):
            rows.append((title, *cells))

    row("IDF1 >= 0.90 with 1 person", ("one",), "idf1")
    row("IDF1 >= 0.90 with 3 crossing", ("three",), "idf1")
    row("IDF1 of 3 at close quarters", ("three close",), "idf1")
    row("IDF1 >= 0.70 with 8", ("eight",), "idf1")
    plain = ("things", "near wall", "hidden", "furniture", "robots", "two lasers", "mirror", "misplaced")
    row("recall 1.0 from 5 cm", plain, "large")
    row(f"the same, of those in sight of two beams for {CLEAR_S:g} s", plain, "clear")
    row("recall >= 0.8 of 3 cm", plain, "small")
    row("recall of black and glossy things", ("glossy",), "recall")
    row("found of those in sight for less than 2 s", None, "glimpsed")
    row("kept while hidden >= 0.99", plain, "kept")
    row("the same, once it was told", plain, "held")
    row("false objects <= 1 in 10 minutes, without furniture", None, "false")
    row("false objects <= 1 per furniture move", None, "move")
    row("removal <= 1 s after it can be seen", plain, "removal_s")
    row("position error <= 20 mm", [s for s in plain if s != "misplaced"], "error_m")
    return "### Against what is asked for (ours)\n\n" + _markdown(head, rows)


def _asked(value: str, scores: Sequence[Scores]) -> str:
    objects = added(one.objects for one in scores)
    if value == "idf1":
        return spread([one.movers.idf1 for one in scores]) + f", worst {min(one.movers.idf1 for one in scores):.2f}"
    if value in ("large", "clear", "small", "recall"):
        sizes = {"large": (0.04, 9.0), "clear": (0.04, 9.0, CLEAR_S), "small": (0.0, 0.04), "recall": (0.0, 9.0)}
        return f"{number(objects.recall(*sizes[value]), 3)} of {len(objects.needed(*sizes[value]))}"
    if value == "glimpsed":
        return f"{sum(span.found for span in objects.glimpsed)} of {len(objects.glimpsed)}"
    if value == "kept":
        return f"{number(objects.kept, 3)} of {sum(span.hidden_s for span in objects.spans):.0f} s"
    if value == "held":
        return f"{number(objects.held, 3)} of {sum(span.known_s for span in objects.spans):.0f} s"
    if value == "false":
        return number(objects.per_ten_minutes("mover", "other"))
    if value == "move":
        return f"{number(objects.per_move())} of {objects.moves}"
    if value == "removal_s":
        values = objects.values(value)
        return f"{_quantiles(values, 1)}; {100 * np.mean(values <= 1):.0f} % in time" if len(values) else ""
    errors = 1e3 * objects.values("error_m")
    return f"{_quantiles(errors, 0)} mm, RMSE {number(float(np.sqrt(np.mean(errors**2))), 0)} mm" if len(errors) else ""


def static_table(rows: Mapping[tuple[str, int], tuple[int, int]], seconds: float) -> str:
    """(contestant, seed) -> (events, labels) after half a minute."""
    found = [(name, str(seed), str(events), str(labels)) for (name, seed), (events, labels) in rows.items()]
    title = f"### {seconds / 3600:g} h without anybody: events and labels after the first half minute\n\n"
    return title + _markdown(("by", "seed", "events", "labels"), found)


def added(scores: Iterable[ObjectScores]) -> ObjectScores:
    total = ObjectScores()
    for one in scores:
        total = total + one
    return total


def spread(values: Sequence[float], digits: int = 2) -> str:
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return "-"
    return f"{np.mean(known):.{digits}f} ± {np.std(known):.{digits}f}"


def number(value: float, digits: int = 2) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "-"


def _quantiles(values: Floats, digits: int) -> str:
    if not len(values):
        return "-"
    return f"{np.median(values):.{digits}f}, {np.percentile(values, 95):.{digits}f}"


def _markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows))
