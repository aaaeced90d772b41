"""The screen of ``tms floor watch``: a view in, lines of text out. Braille dots and plain ANSI."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from tms_agents.floor.watch.canvas import Canvas
from tms_agents.floor.watch.picture import ANSI, draw, frame_of

_PLAIN = "\x1b[0m"
_STATES = {"connected": "32", "silent": "33", "connecting": "33", "faulty": "31"}
_LIST_COLUMNS = 34


def screen(
    view: dict[str, Any],
    *,
    columns: int = 80,
    rows: int = 24,
    colour: bool = False,
    frame: tuple[float, float, float, float] | None = None,
) -> list[str]:
    """At most ``rows`` lines of ``columns`` characters; what does not fit is left out from the bottom up."""
    lines = [_head(view, columns)] + [_laser(one, columns, colour) for one in view["lasers"]]
    story = min(len(view["story"]), max(0, rows - len(lines) - 8), 6)
    height = max(1, rows - len(lines) - story)
    beside = columns >= 70
    width = columns - _LIST_COLUMNS - 1 if beside else columns
    canvas = Canvas(2 * width, 4 * height, frame or frame_of([view]))
    draw(view, canvas)
    listed = _labels(view["labels"], height) if beside else []
    for n, row in enumerate(canvas.braille()[:height]):
        text = _coloured(row) if colour else "".join(one for one, _ in row)
        line = f"{text} {listed[n]}" if n < len(listed) else text
        lines.append(line if colour else line.rstrip())
    lines += [f"{_clock(at)} {text}"[:columns] for at, text in view["story"][len(view["story"]) - story :]]
    return lines[:rows]


def _head(view: dict[str, Any], columns: int) -> str:
    source = {"agent": "the running agent", "devices": "the lasers"}.get(view["source"], view["source"])
    right = f"  {_clock(view['at'])}  from {source}"
    left = f"{view['agent']} in {view['room']}" if view["room"] else view["agent"]
    left = left[: max(1, columns - len(right))]
    return f"{left}{right:>{max(1, columns - len(left))}}"[:columns]


def _laser(one: dict[str, Any], columns: int, colour: bool) -> str:
    rest = one["why"] if one["state"] != "connected" else f"{one['scans']} scans, {len(one['front'])} points in front"
    line = f"laser {one['name']}: {one['state']}  {rest}"[:columns]
    if colour:
        line = line.replace(one["state"], f"\x1b[{_STATES.get(one['state'], '')}m{one['state']}{_PLAIN}", 1)
    return line


def _labels(labels: list[dict[str, Any]], rows: int) -> list[str]:
    if not labels:
        return ["nobody and nothing on the floor"]
    lines = ["   #            x      y    since"]
    for one in sorted(labels, key=lambda label: (label["kind"], label["id"])):
        what = "robot" if one["robot"] else "thing" if one["kind"] == "object" else "mover"
        what = "hidden" if one["stale"] else what
        age = f"{one['age_s']:.0f} s" if one["age_s"] < 600 else f"{one['age_s'] / 60:.0f} min"
        lines.append(f"{one['id']:4d} {what:6s}{one['xy'][0]:7.2f}{one['xy'][1]:7.2f}{age:>9}")
    if len(lines) > rows:
        lines = [*lines[: rows - 1], f"  and {len(lines) - rows + 1} more"]
    return lines


def _coloured(row: list[tuple[str, int]]) -> str:
    text, last = "", 0
    for one, colour in row:
        if colour != last and one != " ":
            text, last = f"{text}\x1b[{ANSI[colour]}m", colour
        text += one
    return text + _PLAIN


def _clock(at: str) -> str:
    return datetime.fromisoformat(at).astimezone().strftime("%H:%M:%S")
