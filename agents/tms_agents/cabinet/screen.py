"""The screen of ``tms cabinet watch``: a view in, lines of text out. Plain ANSI, made for 80 columns and 24 rows."""

from __future__ import annotations

import unicodedata
from datetime import datetime
from typing import Any

_COLOURS = {"connected": "\x1b[32m", "silent": "\x1b[33m", "connecting": "\x1b[33m", "faulty": "\x1b[31m"}
_BOLD, _DIM, _PLAIN = "\x1b[1m", "\x1b[2m", "\x1b[0m"
_BAR = " ▁▂▃▄▅▆▇█"
#: Columns and rows of a board's map, inside its frame.
_MAP = (34, 7)
_LEAST_FULL_G = 500.0


def screen(view: dict[str, Any], *, columns: int = 80, rows: int = 24, colour: bool = False) -> list[str]:
    """At most ``rows`` lines of at most ``columns`` characters; what does not fit is left out from the bottom up."""
    lines = [_head(view, columns)]
    for device, kind in [(one, "board") for one in view["boards"]] + [(one, "reader") for one in view["readers"]]:
        lines.append(_device(device, kind, columns, colour))
    boards = view["boards"]
    room = rows - len(lines) - 3 if view["story"] else rows - len(lines)
    for number, board in enumerate(boards):
        share = max(2, (room - sum(1 for _ in boards[number + 1 :]) * 2) // (len(boards) - number))
        block = _board(board, columns, share)
        room -= len(block)
        lines += block
    left = rows - len(lines) - 1
    if left > 0 and view["story"]:
        lines.append("")
        lines += [_event(at, text, columns) for at, text in view["story"][-(left - 0) :]]
    return [one if _marked(one) else _fit(one, columns) for one in lines[:rows]]


def _head(view: dict[str, Any], columns: int) -> str:
    right = f"  {_clock(view['at'])}  from {'the running agent' if view['source'] == 'agent' else 'the devices'}"
    left = _fit(f"{view['agent']} in {view['room']}", max(1, columns - len(right)))
    return _fit(f"{left}{right:>{max(1, columns - _width(left))}}", columns)


def _device(device: dict[str, Any], kind: str, columns: int, colour: bool) -> str:
    state, why = device["state"]["state"], device["state"]["why"]
    text = f"{kind} {device['name']}: "
    rest = why if state != "connected" else ""
    if kind == "board":
        known = [one["grams"] for one in device["cells"]]
        load = "no load yet" if None in known else f"{sum(known):.0f} g"
        rest = rest or (load if device["knows_load"] else f"{load}, learning what rests on it")
    else:
        read = "; ".join(f"{zone}: {', '.join(tags) or 'nothing'}" for zone, tags in device["zones"].items())
        rest = rest or read or "no round yet"
    line = _fit(f"{text}{state}  {rest}", columns)
    if colour:
        line = line.replace(state, f"{_COLOURS.get(state, '')}{state}{_PLAIN}", 1)
    return line


def _board(board: dict[str, Any], columns: int, rows: int) -> list[str]:
    """The map with cells and things on the left, the list of things on the right."""
    height = max(1, min(_MAP[1], rows - 3))
    if rows < 4:
        return [f"{board['name']}: {len(board['stays'])} things"]
    left = _map(board, height)
    right = _list(board["stays"], columns - _MAP[0] - 4, height + 2)
    blank = " " * (_MAP[0] + 2)
    body = [
        f"{left[n] if n < len(left) else blank}  {right[n] if n < len(right) else ''}"
        for n in range(max(len(left), len(right)))
    ]
    return [f"{board['name']}  {board['width']:.2f} x {board['depth']:.2f} m", *body][:rows]


def _map(board: dict[str, Any], height: int) -> list[str]:
    width = _MAP[0]
    grid = [[" "] * width for _ in range(height)]

    def write(xy: tuple[float, float], text: str) -> None:
        column = round(xy[0] / board["width"] * (width - 1)) - len(text) // 2
        row = height - 1 - round(xy[1] / board["depth"] * (height - 1))
        column, row = min(max(column, 0), width - len(text)), min(max(row, 0), height - 1)
        grid[row][column : column + len(text)] = text

    grams = [one["grams"] for one in board["cells"]]
    full = max([_LEAST_FULL_G, *(abs(one) for one in grams if one is not None)])
    for cell in board["cells"]:
        load = cell["grams"]
        bar = "?" if load is None else _BAR[round(min(1.0, abs(load) / full) * (len(_BAR) - 1))]
        write(cell["xy"], "  ?  " if load is None else f"{bar}{load:.0f}")
    for stay in board["stays"]:
        if stay["xy"] is not None:
            write(stay["xy"], f"#{stay['id']}")
    frame = "+" + "-" * width + "+"
    return [frame, *("|" + "".join(row) + "|" for row in grid), frame]


def _list(stays: list[dict[str, Any]], columns: int, rows: int) -> list[str]:
    if not stays:
        return ["nothing stands on it"]
    head = "    #   weight      x     y  tag"
    lines = [head]
    for one in stays:
        place = f"{one['xy'][0]:6.2f}{one['xy'][1]:6.2f}" if one["xy"] else "     -     -"
        tag = one["tag"] or "?"
        lines.append(f"{one['id']:5d}{one['weight_g']:7.0f} g{place}  {_short(tag, max(4, columns - len(head) + 3))}")
    if len(lines) > rows:
        hidden = len(lines) - rows + 1
        lines = [*lines[: rows - 1], f"  and {hidden} more"]
    return lines


def _event(at: str, text: str, columns: int) -> str:
    return _fit(f"{_clock(at)} {text}", columns)


def _clock(at: str) -> str:
    return datetime.fromisoformat(at).astimezone().strftime("%H:%M:%S")


def _short(text: str, columns: int) -> str:
    """The end of a tag tells it from others."""
    return text if len(text) <= columns else "…" + text[-(columns - 1) :]


def _marked(line: str) -> bool:
    return "\x1b" in line


def _width(text: str) -> int:
    return sum(2 if unicodedata.east_asian_width(one) in "WF" else 1 for one in text)


def _fit(line: str, columns: int) -> str:
    while _width(line) > columns:
        line = line[:-1]
    return line.rstrip()
