"""``tms cabinet calibrate``: lead a person through it, measure, solve, write."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable, Sequence
from typing import NamedTuple

import numpy as np

from tms_agents.cabinet.calibration import CalibrationError, Measured, Solution, solve
from tms_agents.cabinet.config import BoardSection
from tms_agents.cabinet.measuring import AtRest, Measuring
from tms_client.cli import CommandError

#: Worse than this is no calibration: of the weight, and of the position in metres.
_MOST_WEIGHT_ERROR, _MOST_POSITION_ERROR_M = 0.03, 0.02
_SPOT = re.compile(r"\s*([\d.]+)\s*(?:g\s*)?(?:@\s*([\d.]+)\s*,\s*([\d.]+)\s*)?")


class Spot(NamedTuple):
    weight_g: float
    xy: tuple[float, float]


def parse_spots(text: str, board: BoardSection) -> list[Spot]:
    """``500@0.1,0.1;500@0.3,0.1``: grams at x, y in metres on the board; a single scale needs no position.

    Raises:
        CommandError: it says something else, or a spot beside the board.
    """
    spots = []
    for part in text.split(";"):
        found = _SPOT.fullmatch(part)
        try:
            if found is None or (found[2] is None and board.cells is not None):
                raise ValueError
            xy = (board.width / 2, board.depth / 2) if found[2] is None else (float(found[2]), float(found[3]))
            spot = Spot(float(found[1]), xy)
        except ValueError:
            raise CommandError(
                f"{part.strip()!r} is no weight at a place: write 500@0.10,0.20 (grams, metres)"
            ) from None
        if not (0 <= xy[0] <= board.width and 0 <= xy[1] <= board.depth):
            raise CommandError(f"{part.strip()!r} is beside the board, which is {board.width:g} m x {board.depth:g} m")
        spots.append(spot)
    return spots


def usual_spots(weight_g: float, board: BoardSection) -> list[Spot]:
    """Near the corners and in the middle; for one scale, in the middle."""
    middle = Spot(weight_g, (round(board.width / 2, 3), round(board.depth / 2, 3)))
    if board.cells is None:
        return [middle]
    xs, ys = ((round(0.2 * side, 3), round(0.8 * side, 3)) for side in (board.width, board.depth))
    return [*(Spot(weight_g, (x, y)) for y in ys for x in xs), middle]


async def measure_and_solve(
    board: BoardSection,
    measuring: Measuring,
    spots: Sequence[Spot],
    prompt: Callable[[str], Awaitable[None]],
    say: Callable[[str], None],
    *,
    with_positions: bool,
    wait_for_change: bool,
    force: bool,
) -> Solution:
    """``prompt`` says what to do and returns when it is done; with ``wait_for_change`` the load itself tells.

    Raises:
        CommandError: the measurements cannot be had, or give no calibration.
    """
    await prompt(f"Take everything off board {board.name}")
    empty = await measuring.rest()
    say(f"  empty: {_counts(empty)}")
    measured, before = [], empty
    for number, spot in enumerate(spots, 1):
        where = "" if board.cells is None else f" with its middle at x {spot.xy[0]:g}, y {spot.xy[1]:g} m"
        await prompt(f"{number}/{len(spots)}: put {spot.weight_g:g} g on board {board.name}{where}, nothing else")
        others = ((empty, before) if before is not empty else (empty,)) if wait_for_change else ()
        before = await measuring.rest(others, noise=empty.noise)
        say(f"  {_counts(before)}")
        measured.append(Measured(spot.weight_g, spot.xy, before.mean))
    cells = None if with_positions else np.array(board.cells or [(board.width / 2, board.depth / 2)])
    try:
        solution = solve(empty.mean, empty.noise, measured, cells, samples=empty.samples)
    except CalibrationError as error:
        raise CommandError(str(error)) from error
    say(report(board, solution))
    if not force and (why := _too_bad(solution, single=board.cells is None)):
        raise CommandError(f"{why}: was it the right weight at the right place? --force keeps the calibration anyway")
    return solution


def report(board: BoardSection, solution: Solution) -> str:
    """Residuals spot by spot, the cells, and how good it is."""
    lines = ["", "   weight      x      y    error of weight    of position"]
    for one in solution.residuals:
        place = f"{one.xy[0]:6.3f} {one.xy[1]:6.3f}"
        off = np.hypot(*one.error_m) * 1000
        position = "" if board.cells is None else f"{off:10.1f} mm"
        lines.append(
            f"  {one.weight_g:7.1f} {place}  {one.error_g:+8.2f} g {one.error_g / one.weight_g:+7.2%} {position}"
        )
    lines += ["", "  cell      x      y   g per count    +-      offset   noise of a sample"]
    for cell in range(len(solution.gain)):
        x, y = solution.cells[cell]
        lines.append(
            f"  {cell:4d} {x:6.3f} {y:6.3f}  {solution.gain[cell]:+10.5g} {solution.gain_sd[cell]:8.2g} "
            f"{solution.offset[cell]:+10.1f}   {solution.noise_g[cell]:8.2f} g"
        )
    position = "" if board.cells is None else f", position {solution.rmse_position_m * 1000:.1f} mm"
    lines += ["", f"  RMSE: weight {solution.rmse_weight_g:.2f} g{position}; condition {solution.condition:.1f}", ""]
    return "\n".join(lines)


def _too_bad(solution: Solution, *, single: bool) -> str:
    usual = float(np.mean([one.weight_g for one in solution.residuals]))
    if solution.rmse_weight_g > _MOST_WEIGHT_ERROR * usual:
        return f"the weights are off by {solution.rmse_weight_g:.1f} g ({solution.rmse_weight_g / usual:.0%})"
    if not single and solution.rmse_position_m > _MOST_POSITION_ERROR_M:
        return f"the positions are off by {solution.rmse_position_m * 1000:.0f} mm"
    return ""


def _counts(load: AtRest) -> str:
    cells = "  ".join(f"{mean:.1f}+-{noise:.1f}" for mean, noise in zip(load.mean, load.noise, strict=True))
    return f"{cells}  ({load.samples} samples)"
