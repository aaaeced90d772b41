"""How near a contestant comes to the least possible error of position, by weight."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from cabinet_contestants import Contestant, Detection
from cabinet_limits import difference_variance, position_limit, tilted_limit

from tms_agents.simulation.board import BoardParameters, BoardWorld, Change, Recording
from tms_agents.simulation.board_noise import CellParameters

WEIGHTS_G = (25, 50, 100, 200, 500, 1000, 2000)
#: A well calibrated board away from any compressor; drift, creep, antenna noise and rounding are as everywhere.
BOARD = BoardParameters(electronics=CellParameters(vibration_g=0.0, gain_error_sd=0.0))
REST_S, LATE_S = 8.0, 7.0


@dataclass(frozen=True, slots=True)
class Precision:
    """Over the trials in which the thing was found: of the first report, and the last one, some 5 s later (``late``).

    Root mean squares, ``limit_m`` where the place of the force is known to be that of the thing all the time, and
    ``tilted_m`` where the thing may come down on an edge; ``delay_s`` is the median time of the first report after the
    hand has let go, ``late_s`` of the last one; ``covered``: how often the truth was in the first one's 95 % ellipse.
    """

    found: float
    rmse_m: float
    limit_m: float
    tilted_m: float
    late_rmse_m: float
    late_limit_m: float
    delay_s: float
    late_s: float
    covered: float


def precision(contestant: type[Contestant], weight: int, trials: int) -> Precision:
    """Put and take a thing of unknown weight again and again, at random places."""
    matter, places = np.random.default_rng(weight).spawn(2)
    world = BoardWorld(replace(BOARD, even=contestant.even), matter)
    cabinet = contestant(world, {})
    _play(world, cabinet, world.run(5.0))
    squares: list[tuple[float, float, float, float, float]] = []
    delays, late_delays, inside = [], [], []
    for trial in range(trials):
        empty_since = world.settled_at
        idle = world.run(REST_S)
        _play(world, cabinet, idle)
        xy = (float(places.uniform(0.04, 0.425)), float(places.uniform(0.047, 0.27)))
        change = world.place(f"thing{trial}", float(weight), xy, f"E00401{trial:010X}")
        settling = world.run(change.stable - world.time_s + LATE_S)
        said = _play(world, cabinet, settling)
        first = next((one for one in said if one.kind == "in" and one.xy is not None and one.at >= change.start), None)
        if first is not None and first.xy is not None:
            last = [one for one in said if one.stay == first.stay and one.xy is not None][-1]
            assert last.xy is not None
            limits = [
                limit
                for until in (max(first.at, change.start + 0.1), max(last.at, change.start + 0.1))
                for limit in _limits(world, change, empty_since, until)
            ]
            # A stay that was told to be over by then is an error of another kind.
            errors = math.dist(first.xy, xy), math.dist(last.xy, xy) if first.stay in cabinet.standing() else math.nan
            squares.append((errors[0] ** 2, limits[0] ** 2, limits[1] ** 2, errors[1] ** 2, limits[2] ** 2))
            delays.append(first.at - change.stable)
            late_delays.append(last.at - change.stable)
            inside.append(_covers(first, xy))
        _play(world, cabinet, world.run(1.0))
        out = world.take(f"thing{trial}")
        _play(world, cabinet, world.run(out.stable - world.time_s + 2.0))
    if not squares:
        return Precision(0.0, *([math.nan] * 8))
    means = np.sqrt(np.nanmean(np.array(squares), axis=0)).tolist()
    rmse, limit, tilted, late_rmse, late_limit = means
    return Precision(
        found=len(squares) / trials,
        rmse_m=rmse,
        limit_m=limit,
        tilted_m=tilted,
        late_rmse_m=late_rmse,
        late_limit_m=late_limit,
        delay_s=float(np.median(delays)),
        late_s=float(np.median(late_delays)),
        covered=float(np.mean(inside)),
    )


def _covers(said: Detection, xy: tuple[float, float]) -> float:
    """Whether the truth is in the 95 % ellipse, NaN where nothing was said of the error."""
    if said.cov is None or said.xy is None:
        return math.nan
    xx, cross, yy = said.cov
    dx, dy = xy[0] - said.xy[0], xy[1] - said.xy[1]
    return float((yy * dx * dx - 2 * cross * dx * dy + xx * dy * dy) / (xx * yy - cross * cross) < -2 * math.log(0.05))


def _limits(world: BoardWorld, change: Change, empty_since: float, until: float) -> tuple[float, float]:
    """The limits with every sample of the empty board, and every one since the hand touched it ``until`` then."""
    p, thing = world.parameters, world.things[change.name]
    samples = np.arange(math.ceil(empty_since / p.period_s), math.floor(until / p.period_s) + 1)
    t = samples.astype(np.float64) * p.period_s
    factor = np.where(world.reader.on_at(t), p.electronics.rf_noise_factor, 1.0)
    noise, step = p.electronics.noise_sd_g * factor, p.electronics.gram_per_count
    load, before = thing.trace.moments(t)[:, 0] / thing.weight_g, t <= change.start
    tilt = np.clip((change.stable - t) / (change.stable - change.start), 0.0, 1.0)
    variance = difference_variance(noise, load, before, step)
    return (
        position_limit(world.shares, thing.weight_g, thing.xy, variance),
        tilted_limit(world.shares, thing.weight_g, thing.xy, noise, load, tilt, before, p.hands.tilt_m, step),
    )


def _play(world: BoardWorld, cabinet: Contestant, recording: Recording) -> list[Detection]:
    return list(played(world, cabinet, recording))


def played(world: BoardWorld, contestant: Contestant, recording: Recording) -> Iterator[Detection]:
    """Samples and rounds to the contestant, in the order of time."""
    grams = world.grams(recording.counts)
    rounds = iter(recording.rounds)
    due = next(rounds, None)
    for t, sample in zip(recording.t.tolist(), grams, strict=True):
        yield from contestant.load(t, sample)
        while due is not None and due.t <= t + 1e-9:
            yield from contestant.inventory(due.t, due.zone, due.tags)
            due = next(rounds, None)


def draw(by_weight: dict[int, tuple[Precision, Precision]], path: Path) -> None:
    """The table as a picture, both axes logarithmic."""
    try:
        import matplotlib
    except ImportError:
        raise SystemExit("no matplotlib: pip install 'robot-town-tms[dev]'") from None
    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.ticker import FuncFormatter

    weights = list(by_weight)
    ours, laboratory = zip(*by_weight.values(), strict=True)
    figure, axes = pyplot.subplots(figsize=(7, 4.5), layout="constrained")
    mm = 1e3
    axes.plot(weights, [mm * one.rmse_m for one in laboratory], "s-", color="#b4540a", label="laboratory's algorithm")
    axes.plot(weights, [mm * one.rmse_m for one in ours], "o-", color="#1f5fa8", label="first report")
    axes.plot(weights, [mm * one.tilted_m for one in ours], ":", color="#1f5fa8", label="its limit, tilt unknown")
    axes.plot(weights, [mm * one.limit_m for one in ours], "--", color="#1f5fa8", label="its Cramér-Rao limit")
    axes.plot(
        weights, [mm * one.late_rmse_m for one in ours], "o-", color="#2a8a4a", label="told again, some 5 s later"
    )
    axes.plot(weights, [mm * one.late_limit_m for one in ours], "--", color="#2a8a4a", label="its Cramér-Rao limit")
    axes.set(
        xscale="log",
        yscale="log",
        xticks=weights,
        xlabel="weight of the thing in g",
        ylabel="position error (root mean square) in mm",
        title="Where on the board? Four cells, noise 8 g, counts of 5 g",
    )
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.minorticks_off()
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
