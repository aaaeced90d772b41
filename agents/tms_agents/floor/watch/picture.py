"""A view of the floor (see ``live_view``) as a picture: walls, what is before them, movers and trails, things."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from tms_agents.floor.watch.canvas import Canvas

#: Numbers of colours; where two meet in a character of the terminal, the higher one is seen.
GROUND, PLAN, WALL, TRAIL, FRONT, LASER, THING, MOVER, ROBOT, STALE = range(10)
#: For light paper: red, green, blue.
PALETTE = (
    (255, 255, 255), (205, 214, 224), (120, 130, 140), (244, 178, 120), (60, 120, 200), (30, 150, 90), (190, 30, 120),
    (215, 85, 0), (110, 70, 180), (170, 140, 110),
)  # fmt: skip
#: For terminals: ANSI codes.
ANSI = ("", "90", "37", "33", "36", "32", "95", "93", "35", "90")
_MARGIN_M = 0.3
#: Half the width of what stands for a mover or a thing (m); dots at least.
_MOVER_M, _THING_M = 0.15, 0.06
#: Colours of trails that are told apart, for pictures of whole recordings.
_TRAILS = ((214, 39, 40), (31, 119, 180), (44, 160, 44), (148, 103, 189), (255, 127, 14), (23, 190, 207), (140, 86, 75))


def frame_of(views: Iterable[Mapping[str, Any]]) -> tuple[float, float, float, float]:
    """What a picture has to show: the region where it is known, otherwise all that lasers see, without the farthest."""
    xs: list[float] = []
    ys: list[float] = []
    for view in views:
        region = view["scene"].get("region")
        points = list(region) if region else []
        for laser in view["lasers"]:
            points.append(laser["pose"][:2])
            points += [] if region else laser["walls"]
        points += [label["xy"] for label in view["labels"]]
        xs += [point[0] for point in points]
        ys += [point[1] for point in points]
    if not xs:
        return (-1.0, -1.0, 1.0, 1.0)
    xs.sort()
    ys.sort()
    cut = len(xs) // 200
    return (
        xs[cut] - _MARGIN_M, ys[cut] - _MARGIN_M, xs[-1 - cut] + _MARGIN_M, ys[-1 - cut] + _MARGIN_M
    )  # fmt: skip


def draw(view: Mapping[str, Any], canvas: Canvas, *, numbers: int = 0, dot: int = 1) -> None:
    """``numbers``: how large the numbers of labels are, 0 for none; ``dot``: how large points are."""
    scene = view["scene"]
    if scene.get("region"):
        canvas.line(scene["region"], PLAN, closed=True)
    for name in ("gates", "masks", "seats"):
        for polygon in scene.get(name) or ():
            canvas.line(polygon, PLAN, closed=True, dashed=True)
    for mirror in scene.get("mirrors") or ():
        canvas.line(mirror, PLAN)
    for laser in view["lasers"]:
        canvas.points(laser["walls"], WALL, dot)
        canvas.points(laser["front"], FRONT, dot)
        canvas.ring(laser["pose"], max(0.04, 1.5 / canvas.scale), LASER, filled=True)
    for label in view["labels"]:
        if label["trail"]:
            canvas.line(label["trail"], TRAIL)
    for label in view["labels"]:
        _mark(label, canvas, numbers)


def _mark(label: Mapping[str, Any], canvas: Canvas, numbers: int) -> None:
    if label["kind"] == "object":
        radius, colour = max(_THING_M, 1.2 / canvas.scale), THING
    else:
        radius = max(_MOVER_M, 2.0 / canvas.scale)
        colour = STALE if label["stale"] else ROBOT if label["robot"] else MOVER
    canvas.ring(label["xy"], radius, colour, filled=label["kind"] == "object")
    if numbers:
        x, y = label["xy"]
        canvas.text((x + radius, y + radius), str(label["id"]), colour, numbers)


def png(view: Mapping[str, Any], width: int = 900, frame: tuple[float, float, float, float] | None = None) -> bytes:
    """A PNG file of a view, ``width`` dots wide."""
    frame = frame or frame_of([view])
    height = round(width * (frame[3] - frame[1]) / (frame[2] - frame[0]))
    canvas = Canvas(width, max(50, min(height, 4 * width)), frame)
    draw(view, canvas, numbers=2, dot=2)
    return canvas.png(PALETTE)


def tracks_png(
    view: Mapping[str, Any], tracks: Sequence[tuple[int, str, Sequence[Sequence[float]]]], width: int = 900
) -> bytes:
    """The whole of a recording in one picture: (number, mover or object, places) of every label, over its walls."""
    everything = {**view, "labels": [*view["labels"], *({"xy": place} for _, _, places in tracks for place in places)]}
    x0, y0, x1, y1 = frame_of([everything])
    frame = (x0, y0 - 0.06 * (x1 - x0), x1, y1)  # with a place for the scale
    height = round(width * (frame[3] - frame[1]) / (frame[2] - frame[0]))
    canvas = Canvas(width, max(50, min(height, 4 * width)), frame)
    draw({**view, "labels": []}, canvas, dot=2)
    palette = list(PALETTE)
    for n, (number, kind, places) in enumerate(tracks):
        if not places:
            continue
        colour = len(PALETTE) + n % len(_TRAILS)
        if kind == "object":
            canvas.ring(places[-1], _THING_M, colour, filled=True)
        else:
            for shift in (-0.5, 0.5):
                canvas.line([(x + shift / canvas.scale, y) for x, y in places], colour)
            canvas.ring(places[0], _THING_M, colour)
        canvas.text((places[-1][0] + 0.05, places[-1][1] + 0.05), str(number), colour, 3)
    _scale(canvas, frame)
    palette += _TRAILS
    return canvas.png(palette)


def _scale(canvas: Canvas, frame: tuple[float, float, float, float]) -> None:
    """A metre, in the lower left corner."""
    x, y = frame[0] + 5 / canvas.scale, frame[1] + 5 / canvas.scale
    tick = 5 / canvas.scale
    canvas.line([(x, y + tick), (x, y), (x + 1.0, y), (x + 1.0, y + tick)], WALL)
    canvas.text((x + tick, y + tick), "1 m", WALL, 2)
