"""Fits the numbers that the costs of feet are made of (`tms_agents.floor.feet.fitted`).

    python benchmarks/floor_whose.py                 how likely the numbers in use make the right explanations
    python benchmarks/floor_whose.py --fit           and fits them again (ten minutes)
    python benchmarks/floor_whose.py --fit --feet prints
    python benchmarks/floor_whose.py --seeds 2001-2032 --scenes "three,three close" --lasers coarse

The estimator plays simulated rooms and is told afterwards whose each foot was (`floor_told`). Of each scan near
somebody else, or near what is nobody's, all ways to tell whose the clusters are are added up: a conditional logit model
(McFadden 1974) of whole explanations, not of single feet. A quarter of the worlds (seeds that 4 divides) is kept aside.
What a foot costs that is put down just anywhere is held (`HELD`): the fit would make it cheaper to be somebody new than
to come out from behind something, since what becomes of the name is not in it; labels are lost so, above all where
furniture is moved.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from floor_told import Explained, Job, Told
from numba import njit, prange
from numpy.typing import NDArray
from scipy.optimize import minimize

from tms_agents.floor.feet.bodies import narrow
from tms_agents.floor.feet.fitted import LEGS, SHOES, Legs, Shoes
from tms_agents.floor.feet.likelihood import feet_by
from tms_agents.floor.feet.missed import missed
from tms_agents.floor.feet.one_foot import UNLIKELY
from tms_agents.floor.scan.clustered import ClusteredScan
from tms_agents.floor.settings import Polygon
from tms_agents.simulation.floor_world import LASERS, SCENARIOS

Array = NDArray[np.float64]

#: Numbers that are not fitted.
HELD = ("ahead_s", "ahead_m", "ahead_aside_m", "anywhere", "around_m", "around", "beside_m", "beside")
#: The numbers of each kind of feet.
IN_USE: dict[str, Legs | Shoes] = {"legs": LEGS, "prints": SHOES}
#: People so near each other (m), or so near (m) what is nobody's, might be taken for each other; what is farther (m)
#: from all of them is left out. Who is seen so often is known.
_NEAR_M, _NOBODYS_M, _AROUND_M, _KNOWN = 1.5, 1.0, 1.2, 20
#: So many people and clusters at most: all explanations are added up.
_PEOPLE, _CLUSTERS = 4, 8
#: An explanation that costs so much more than the cheapest, and a foot that costs so much, adds nothing.
_NOTHING, _NEVER = 25.0, 30.0
#: A cluster is somebody's if this share of its echoes is; nobody's anyway, if that costs less.
_SHARE, _ANYWAY = 0.3, 5.0
#: Numbers are pulled to what they were; situations as clear as this (nats) are thinned out to this share.
_PULL, _CLEAR, _THINNED, _KEPT_ASIDE = 5e-4, 0.02, 0.03, 4


class Situation(NamedTuple):
    """A scan near others: people (k,) and clusters (m,) with their prints (m,), and whose they are.

    ``whose`` (m, k + 1) allows each cluster to be a foot of each, or nobody's, in the right explanation; ``nobodys``
    (m,) is what that costs; ``missed`` (k,) what it costs that somebody was not seen.
    """

    seed: int
    t: float
    bodies: Any
    clusters: Any
    of: NDArray[np.int64]
    marks: Array
    prints: Any
    nobodys: Array
    missed: Array
    whose: NDArray[np.bool_]


class _Situations(Told):
    """Notes every scan in which people are near others, or near what is nobody's."""

    def __init__(self, most: int, prints: int, seats: Sequence[Polygon], job: Job) -> None:
        super().__init__(most, prints, seats, job)
        self.noted: list[Situation] = []

    def explained(self, found: Explained) -> None:
        scan, rows = found.scan, found.rows
        clusters = scan.clusters
        bodies = self.bodies[rows]
        who = [self.tracks.get(int(row)) for row in rows]
        owners = [self._owners(c) for c in clusters]
        known = np.array([one in self.people for one in who]) & (bodies["robot"] == 0) & (bodies["hits"] > _KNOWN)
        apart = _apart(bodies, bodies) + 1e9 * np.eye(rows.size)
        away = _apart(bodies, clusters)
        strange = np.array([not any(owner in who for owner in ones) for ones in owners])
        among = known & ((apart[:, known] < _NEAR_M).any(axis=1) | (away[:, strange] < _NOBODYS_M).any(axis=1))
        near = np.flatnonzero(among)
        if not 0 < near.size <= _PEOPLE or (apart[np.ix_(~known, near)] < _NEAR_M).any():
            return
        seen = np.flatnonzero((away[near] < _AROUND_M).any(axis=0))
        if not 0 < seen.size <= _CLUSTERS:
            return
        prints = scan.prints[np.maximum(scan.of[seen], 0)].copy()
        place = {int(rows[k]): index for index, k in enumerate(near)}
        prints["owner"] = [place.get(int(owner), -1) for owner in prints["owner"]]
        cost = found.cost[seen]
        theirs = np.array([[who[k] in owners[i] for k in near] for i in seen])
        least = np.array([[cost[j, 2 * k : 2 * k + 2].min() for k in near] for j in range(seen.size)])
        nobodys = cost[:, 2 * rows.size :].min(axis=1)
        self.noted.append(
            Situation(
                self.job.seed,
                scan.t,
                bodies[near].copy(),
                clusters[seen].copy(),
                np.where(scan.of[seen] >= 0, np.arange(seen.size), -1),
                scan.marks[seen].copy(),
                prints,
                nobodys,
                np.array([missed(self.bodies[rows[k]], scan.t, found.sight, self.seats) for k in near]),
                _allowed(clusters[seen], nobodys, theirs, least),
            )
        )

    def _owners(self, c: Any) -> tuple[int, ...]:
        """Whose the echoes of a cluster are: two people's, maybe."""
        met = self.owners[c["first"] : c["last"] + 1]
        met = met[met >= 0]
        who, often = np.unique(met, return_counts=True)
        return tuple(int(one) for one, n in zip(who, often, strict=True) if n >= _SHARE * met.size)


def situations(job: Job, duration: float | None = None) -> list[Situation]:
    """Play one room, ``duration`` s of it or all: the scans near others."""
    return _Situations.play(job, duration).noted


def _apart(one: Any, two: Any) -> Array:
    away: Array = np.hypot(one["x"][:, None] - two["x"], one["y"][:, None] - two["y"])
    return away


def _allowed(clusters: Any, nobodys: Array, theirs: NDArray[np.bool_], least: Array) -> NDArray[np.bool_]:
    """Whose (m, k + 1) each cluster may be in the right explanation, the last: nobody's.

    Somebody's is nobody's only if he has three, if it is hardly a foot, is taken for nobody's anyway, or could not be
    his; what is hardly a foot and nobody's may be anybody's.
    """
    shred = np.array([bool(narrow(c)) or bool(c["attached"]) for c in clusters])
    third = (theirs & (theirs.sum(axis=0) > 2)).any(axis=1)
    never = np.where(theirs, least, np.inf).min(axis=1) >= UNLIKELY
    nobody = ~theirs.any(axis=1)
    allowed = np.concatenate([theirs, (nobody | third | never | shred | (nobodys < _ANYWAY))[:, None]], axis=1)
    allowed[nobody & shred] = True
    return allowed


class Data:
    """Situations (n,) one after the other, as the kernel takes them."""

    def __init__(self, noted: Sequence[Situation]) -> None:
        self.seeds = np.array([one.seed for one in noted])
        self._people = np.concatenate([[0], np.cumsum([one.bodies.size for one in noted])])
        self._seen = np.concatenate([[0], np.cumsum([one.clusters.size for one in noted])])
        whose = np.zeros((self._seen[-1], _PEOPLE + 1), np.bool_)
        for one, start in zip(noted, self._seen, strict=False):
            whose[start : start + len(one.whose), : one.whose.shape[1]] = one.whose
        joined = (np.concatenate([one[field] for one in noted]) for field in range(2, 9))
        self._arrays = (np.array([one.t for one in noted]), *joined, whose)

    def nats(self, numbers: Legs | Shoes = LEGS) -> Array:
        """Negative log likelihood (n,) of the right explanation of each, by these numbers of legs or of shoes."""
        legs, shoes = (numbers, SHOES) if isinstance(numbers, Legs) else (LEGS, numbers)
        value = np.empty(self.seeds.size)
        kernel: Any = _nats
        kernel(legs, shoes, self._people, self._seen, *self._arrays, value)
        return value


@njit(parallel=True)
def _nats(
    legs: Legs,
    shoes: Shoes,
    people: NDArray[np.int64],
    seen: NDArray[np.int64],
    times: Array,
    bodies: Any,
    clusters: Any,
    of: NDArray[np.int64],
    marks: Array,
    prints: Any,
    nobodys: Array,
    missed: Array,
    whose: NDArray[np.bool_],
    value: Array,
) -> None:
    for s in prange(times.size):
        mine, here = slice(people[s], people[s + 1]), slice(seen[s], seen[s + 1])
        k, m = people[s + 1] - people[s], seen[s + 1] - seen[s]
        free, cost = np.ones(m, np.bool_), np.empty((m, 2 * k))
        scan = ClusteredScan(clusters[here], of[here], marks[here], prints[here], times[s], clusters[:1])
        for row in range(k):
            feet_by(legs, shoes, scan, free, bodies[mine], row, cost[:, 2 * row : 2 * row + 2])
        least = 0.0
        for i in range(m):
            least += min(cost[i].min(), nobodys[seen[s] + i])
        taken = np.zeros(2 * k, np.bool_)
        every = np.ones((m, k + 1), np.bool_)
        total = _explained(0, cost, nobodys[here], missed[mine], every, taken, -least)
        right = _explained(0, cost, nobodys[here], missed[mine], whose[here], taken, -least)
        value[s] = min(np.log(total) - np.log(max(right, 1e-30)), 20.0)


@njit(cache=False)
def _explained(
    i: int,
    cost: Array,
    nobodys: Array,
    missed: Array,
    whose: NDArray[np.bool_],
    taken: NDArray[np.bool_],
    so_far: float,
) -> float:
    """The sum of the likelihoods of all explanations of the clusters from i on that ``whose`` allows."""
    m, columns = cost.shape
    if i == m:
        for row in range(columns // 2):
            if not taken[2 * row] and not taken[2 * row + 1]:
                so_far += missed[row]
        return float(np.exp(-so_far))
    total = 0.0
    if whose[i, columns // 2]:
        total += _explained(i + 1, cost, nobodys, missed, whose, taken, so_far + nobodys[i])
    for j in range(columns):
        if not taken[j] and whose[i, j // 2] and cost[i, j] < _NEVER and so_far + cost[i, j] < _NOTHING:
            taken[j] = True
            total += _explained(i + 1, cost, nobodys, missed, whose, taken, so_far + cost[i, j])
            taken[j] = False
    return total


def fit(noted: Sequence[Situation], feet: Any = "legs", most: int = 16, seed: int = 0) -> Legs | Shoes:
    """The numbers of ``feet`` by which the right explanations are likely, after so many steps."""
    everything = Data(noted).nats()
    rng = np.random.default_rng(seed)
    kept = [i for i in range(len(noted)) if everything[i] > _CLEAR or rng.random() < _THINNED]
    weights = np.array([1.0 if everything[i] > _CLEAR else 1.0 / _THINNED for i in kept]) / len(noted)
    data = Data([noted[i] for i in kept])
    before = IN_USE[feet]
    start = np.array(before)
    fitted = [index for index, name in enumerate(before._fields) if name not in HELD]

    def numbers(x: Array) -> Legs | Shoes:
        values = start.copy()
        values[fitted] *= np.exp(x)
        return type(before)(*values.tolist())

    def objective(x: Array) -> float:
        return float(weights @ data.nats(numbers(x)) + _PULL * x @ x)

    def slope(x: Array) -> Array:
        at, step = objective(x), 1e-3
        return np.array([(objective(x + step * one) - at) / step for one in np.eye(x.size)])

    zero, bounds = np.zeros(len(fitted)), [(-1.6, 1.6)] * len(fitted)
    best = minimize(objective, zero, jac=slope, method="L-BFGS-B", bounds=bounds, options={"maxiter": most})
    return numbers(best.x)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=_seeds, default=range(2001, 2017), metavar="FIRST-LAST", help="2001-2016")
    scenes = "three,three close,things,furniture,visits,bed,one,robots"
    parser.add_argument("--scenes", default=scenes, help="comma separated")
    parser.add_argument("--lasers", default="coarse,faint", help="comma separated")
    parser.add_argument("--feet", choices=sorted(IN_USE), default="legs")
    parser.add_argument("--fit", action="store_true", help="fit the numbers again")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    args = parser.parse_args(arguments)
    for name, given, there in (("scene", args.scenes, SCENARIOS), ("laser", args.lasers, LASERS)):
        if unknown := set(given.split(",")) - set(there):
            parser.error(f"no {name} {', '.join(sorted(unknown))}; there are {', '.join(sorted(there))}")
    lasers, scenes = args.lasers.split(","), args.scenes.split(",")
    jobs = [Job(scene, seed, args.feet, laser) for laser in lasers for scene in scenes for seed in args.seeds]
    with ProcessPoolExecutor(args.jobs) as pool:
        noted = [one for found in pool.map(situations, jobs) for one in found]
    aside = [one for one in noted if one.seed % _KEPT_ASIDE == 0]
    print(f"{len(noted)} situations, {len(aside)} kept aside: {Data(aside or noted).nats().mean():.4f} nats")
    if args.fit:
        best = fit([one for one in noted if one.seed % _KEPT_ASIDE], args.feet)
        print(f"fitted: {Data(aside or noted).nats(best).mean():.4f} nats")
        for name, before, now in zip(best._fields, IN_USE[args.feet], best, strict=True):
            print(f"    {name}: float = {now:.3f}  # was {before:.3f}")


def _seeds(text: str) -> range:
    first, last = (int(one) for one in text.split("-"))
    return range(first, last + 1)


if __name__ == "__main__":
    main()
