"""The fit of `tms_agents.floor.feet.landing`: a conditional logit model of whose shoe has landed (McFadden 1974)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from tms_agents.floor.feet import landing

Array = NDArray[np.float64]

#: Numbers of `landing`, those that are standard deviations or the like as logarithms.
_PLAIN = ("_AHEAD_M", "_PER_SPEED", "_PER_LAG", "_TURNS", "_ANY_STEP")
_POSITIVE = ("_ALONG_M", "_ALONG_MORE", "_ASIDE_M", "_ASIDE_MORE", "_TURNS_M", "_TURNS_MORE", "_STEP_M", "_STEP_MORE")
_KEPT_ASIDE = 4
#: Tables are pulled to what they were: where nobody lands nothing is learned.
_PULL = 1e-4


@dataclass(slots=True)
class Candidate:
    """One who may have put down a foot: what that costs, of which ``extra`` does not come from where he is and when.

    Of a shoe that lands: ahead of the body, aside, from the other foot (m), speed (m/s), variance (m²), usual stride
    (m), for how long the shoe was up and the other one stands (s).
    """

    cost: float
    extra: float
    owner: bool
    lands: bool
    shoe: bool
    state: tuple[float, ...] = ()


@dataclass(slots=True)
class Choice:
    """A foot that has appeared, and who may have put it down."""

    seed: int
    candidates: list[Candidate] = field(default_factory=list)

    @property
    def right(self) -> bool:
        return min(self.candidates, key=lambda one: one.cost).owner


class _Data:
    """Those (n,) who would have had to land there, of choices among several: ``of`` (n,) which choice.

    Whoever rolls off there, or stands, is another matter: fitted against what that costs, too, landings become cheap
    and names are lost more often.
    """

    def __init__(self, choices: list[Choice]) -> None:
        landed = [[one for one in choice.candidates if one.lands] for choice in choices]
        landed = [ones for ones in landed if len(ones) > 1 and any(one.owner for one in ones)]
        rows = [(k, one) for k, ones in enumerate(landed) for one in ones]
        self.of = np.array([k for k, _ in rows])
        self.count = len(landed)
        self.owner = np.array([one.owner for _, one in rows])
        self.extra = np.array([one.extra for _, one in rows])
        self.state = np.array([one.state for _, one in rows]).T

    def loss(self, costs: Array) -> float:
        """Mean negative log likelihood of the owners."""
        least = np.full(self.count, np.inf)
        np.minimum.at(least, self.of, costs)
        total = np.zeros(self.count)
        np.add.at(total, self.of, np.exp(least[self.of] - costs))
        mine = np.zeros(self.count)
        np.add.at(mine, self.of[self.owner], np.exp(least[self.of] - costs)[self.owner])
        return float(np.mean(np.log(total) - np.log(np.maximum(mine, 1e-300))))

    def right(self, costs: Array) -> float:
        """Share of the choices in which the owner costs least."""
        least = np.full(self.count, np.inf)
        np.minimum.at(least, self.of, costs)
        won = self.owner & (costs <= least[self.of])
        return float(np.bincount(self.of[won], minlength=self.count).clip(0, 1).mean())


def fit(choices: list[Choice]) -> None:
    """Print the numbers that make the owners likeliest, and how well both do on the worlds that were kept aside."""
    learn = _Data([one for one in choices if one.seed % _KEPT_ASIDE])
    aside = _Data([one for one in choices if not one.seed % _KEPT_ASIDE])
    start = _start()
    print(f"fitting {start.size} numbers to {learn.count} choices; {aside.count} kept aside")
    pull = np.where(np.arange(start.size) < len(_PLAIN) + len(_POSITIVE), 0.0, _PULL)

    def objective(numbers: Array) -> float:
        return learn.loss(_costs(numbers, learn)) + float(pull @ (numbers - start) ** 2)

    best = minimize(objective, start, method="L-BFGS-B", options={"maxiter": 120, "maxfun": 10**6}).x
    for name, numbers in (("as it is", start), ("fitted", best)):
        costs = _costs(numbers, aside)
        print(f"{name}: kept aside {aside.loss(costs):.4f} nats, {aside.right(costs):.4f} right;", end=" ")
        print(f"fitted to {learn.loss(_costs(numbers, learn)):.4f} nats")
    print({name: round(float(value), 3) for name, value in _numbers(best).items() if np.ndim(value) == 0})
    print("_UP", np.round(_numbers(best)["_UP"], 2).tolist())
    print("_OTHER", np.round(_numbers(best)["_OTHER"], 2).tolist())


def _start() -> Array:
    plain = [getattr(landing, name) for name in _PLAIN]
    positive = [np.log(getattr(landing, name)) for name in _POSITIVE]
    return np.concatenate([plain, positive, landing._UP, landing._OTHER])


def _numbers(x: Array) -> dict[str, Any]:
    a, b = len(_PLAIN), len(_PLAIN) + len(_POSITIVE)
    named: dict[str, Any] = dict(zip(_PLAIN, x[:a], strict=True))
    named |= zip(_POSITIVE, np.exp(x[a:b]), strict=True)
    return named | {"_UP": x[b : b + landing._UP.size], "_OTHER": x[b + landing._UP.size :]}


def _costs(x: Array, data: _Data) -> Array:
    """What `landing.landing` would cost with these numbers, and what else it costs."""
    n = _numbers(x)
    ahead, aside, step, speed, pp, stride, up, other = data.state
    off = ahead - n["_AHEAD_M"] - n["_PER_SPEED"] * speed + n["_PER_LAG"] * (ahead - step)
    along, across = n["_ALONG_M"] ** 2 + n["_ALONG_MORE"] * pp, n["_ASIDE_M"] ** 2 + n["_ASIDE_MORE"] * pp
    around = n["_TURNS_M"] ** 2 + n["_TURNS_MORE"] * pp
    goes_on = -0.5 * (off * off / along + aside * aside / across + np.log(along * across))
    turns = n["_TURNS"] - 0.5 * (ahead * ahead + aside * aside) / around - np.log(around)
    lengths = n["_STEP_M"] ** 2 + n["_STEP_MORE"] * pp
    length = -0.5 * ((step - stride) ** 2 / lengths + np.log(lengths * landing._WIDTH_M**2))
    value = np.logaddexp(goes_on, turns)
    value += np.logaddexp(length, n["_ANY_STEP"]) * np.minimum(speed / landing._STEPS, 1.0)
    value += np.interp(up, landing._UP_S, n["_UP"]) + np.interp(other, landing._OTHER_S, n["_OTHER"])
    stands = (other > landing._LONG_S) & (other < landing._NEVER_S)
    value -= np.log(np.where(stands, other / landing._LONG_S, 1.0))
    return np.asarray(landing._LEVEL - value + data.extra)
