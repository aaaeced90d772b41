"""Where somebody is, by his feet: fits the numbers of `tms_agents.floor.feet.place`, and what they are worth.

    python benchmarks/floor_places.py
    python benchmarks/floor_places.py --fine 1400-1414 --coarse 2001-2012

The estimator plays simulated rooms in which shoes are seen. Whenever a label has followed the same person for a second,
what is known of the feet and where he really is go together. Seeds that 3 divides are kept aside: the table tells, of
them, how far off the filter is, the place as it is told now, and the place by the numbers fitted here.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from floor_contestants import Ours
from numpy.typing import NDArray

from tms_agents.floor.feet.build import SHOES
from tms_agents.floor.feet.place import AGES_S, LONG_S, TERMS, known, place
from tms_agents.simulation.floor_world import LASERS, FloorWorld

Floats = NDArray[np.float64]
SCENES = {"fine": ("one", "three", "three close", "eight"), "coarse": ("three", "three close")}
#: A label is his if it has been nearest to him, within this (m), for so many scans in a row.
_HIS_M, _SCANS = 1.2, 10
_ASIDE = 3


@dataclass(frozen=True, slots=True)
class Samples:
    """Of n scans of people: case and age (n,), terms (n, k, 2), errors (n, 2) m of the filter and as told now."""

    case: NDArray[np.int64]
    age: Floats
    terms: Floats
    filtered: Floats
    told: Floats
    aside: NDArray[np.bool_]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fine", default="1400-1414", help="first and last seed")
    parser.add_argument("--coarse", default="2001-2012", help="the same of the coarse laser")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    args = parser.parse_args(arguments)
    jobs = [
        (scene, seed, laser)
        for laser, seeds in (("fine", args.fine), ("coarse", args.coarse))
        for scene in SCENES[laser]
        for seed in range(int(seeds.split("-")[0]), int(seeds.split("-")[-1]) + 1)
    ]
    with ProcessPoolExecutor(args.jobs) as pool:
        rows = [row for rows in pool.map(watched, jobs) for row in rows]
    samples = Samples(*(np.array(column) for column in zip(*rows, strict=True)))
    terms = fit(samples)
    fitted = samples.filtered + added(samples, terms)
    print("| place by | error m (rms) | farther than 0.5 m |\n|---|---|---|")
    for name, errors in (("the filter", samples.filtered), ("told now", samples.told), ("fitted", fitted)):
        away = np.hypot(*errors[samples.aside].T)
        print(f"| {name} | {np.sqrt((away**2).mean()):.3f} | {(away > 0.5).mean():.4f} |")
    print(f"\nTERMS = {np.round(terms, 3).tolist()}\nVARIANCES = {np.round(variances(samples, fitted), 3).tolist()}")


def watched(job: tuple[str, int, str]) -> list[tuple[Any, ...]]:
    """A row of `Samples` for every scan of everybody in one world."""
    scene, seed, laser = job
    world = FloorWorld(scene, seed, feet="prints", laser=LASERS[laser])
    sensors = {name: (mount.laser.sweep(), mount.reported) for name, mount in world.sensors.items()}
    ours = Ours(sensors, world.known())
    scans, poses = [], []
    for frame in world.scans():
        ours.scan(frame.sensor, frame.t, frame.ranges, frame.intensities if laser == "fine" else None)
        bodies = ours.estimator._tracks.bodies
        there = (bodies["used"] == 1) & (bodies["confirmed"] == 1) & (bodies["stale"] == 0) & (bodies["robot"] == 0)
        scans.append(frame.t)
        poses.append(bodies[there].copy())
    people = world.truth()["movers"]
    rows, followed = [], dict[int, list[str]]()
    for k, (t, bodies) in enumerate(zip(scans, poses, strict=True)):
        here = {one["id"]: k - one["frames"][0] for one in people if one["frames"][0] <= k < one["frames"][1]}
        at = {
            one["id"]: np.array([one["x"][i], one["y"][i]]) for one in people if (i := here.get(one["id"])) is not None
        }
        for body in bodies:
            xy = np.array([body["x"], body["y"]])
            nearest = min(at, key=lambda who: float(np.hypot(*(at[who] - xy))), default=None)
            if nearest is None or np.hypot(*(at[nearest] - xy)) > _HIS_M:
                continue
            track = followed.setdefault(int(body["label"]), [])
            track.append(nearest)
            if body["shoe"] >= SHOES and len(track) >= _SCANS and set(track[-_SCANS:]) == {nearest}:
                x, y, _ = place(body, t)
                row = (*known(body, t), xy - at[nearest], np.array([x, y]) - at[nearest], seed % _ASIDE == 0)
                rows.append(row)
    return rows


def fit(samples: Samples) -> Floats:
    """The terms (cases, k, 2) that leave the least square error: just now, and after `LONG_S`."""
    found = np.zeros_like(TERMS)
    for case in range(len(TERMS)):
        mine = (samples.case == case) & ~samples.aside
        columns = _columns(samples, mine).reshape(int(mine.sum()), -1, 2)
        table = np.concatenate([columns[:, :, 0], columns[:, :, 1]])
        off = np.concatenate([-samples.filtered[mine, 0], -samples.filtered[mine, 1]])
        found[case] = np.linalg.lstsq(table, off, rcond=None)[0].reshape(TERMS.shape[1:])
    return found


def added(samples: Samples, terms: Floats) -> Floats:
    """What the terms add to the place of the filter, (n, 2) m."""
    everything = np.ones(len(samples.case), np.bool_)
    return np.asarray(np.einsum("nkse,nks->ne", _columns(samples, everything), terms[samples.case]))


def _columns(samples: Samples, these: NDArray[np.bool_]) -> Floats:
    """(n, k, 2 ages, 2 axes)."""
    share = np.minimum(samples.age[these] / LONG_S, 1.0)
    ages = np.stack([1.0 - share, share], axis=1)
    return np.asarray(samples.terms[these][:, :, None, :] * ages[:, None, :, None])


def variances(samples: Samples, errors: Floats) -> Floats:
    """Mean square error of one axis, by case and near each of `AGES_S`."""
    square = (errors**2).sum(axis=1) / 2
    nearest = np.abs(samples.age[:, None] - AGES_S).argmin(axis=1)
    return np.array(
        [[square[(samples.case == case) & (nearest == k)].mean() for k in range(len(AGES_S))] for case in range(4)]
    )


if __name__ == "__main__":
    main()
