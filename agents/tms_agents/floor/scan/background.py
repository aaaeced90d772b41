"""What each beam sees when nothing is there: a mixture of ranges and of no echo, learned all the time."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.scan.components import SIGMA_M, SIGMA_PER_M, adopt
from tms_agents.floor.scan.returning import GONE_S, whole
from tms_agents.floor.scan.weak_echoes import FAINT, LATER_S, believe
from tms_agents.floor.settings import FloorSettings

Array = NDArray[np.float64]
States = NDArray[np.int8]

#: What a beam shows: nothing usable, no echo, the background, something before it, something beyond it.
UNKNOWN, NO_ECHO, BACKGROUND, FOREGROUND, BEYOND = 0, 1, 2, 3, 4

_COMPONENTS = 4
#: A settled component weighs so much; what intermittent beams show less often is not believed.
_WEIGHT = 0.06
#: What a beam shows in more of the scans than this is what it mostly ends at.
_MOSTLY = 0.5
#: What is silent less often than this is missed where nothing comes back.
_SILENT = 0.7
#: What ends so far (m) beyond something passes it.
_BEYOND_M = 0.1


@njit(cache=True)
def _longest_of(centre: Array, weight: Array, least: Array, i: int) -> float:
    """The farthest component of beam i that is believed, m; 0 if there is none."""
    far = 0.0
    for j in range(centre.shape[1]):
        if weight[i, j] > least[i] and centre[i, j] > far:
            far = centre[i, j]
    return far


@njit(cache=True)
def _classify(
    ranges: Array,
    centre: Array,
    sigma: Array,
    weight: Array,
    empty: Array,
    missing: Array,
    least: Array,
    sigmas: float,
    threshold: float,
    states: States,
    longest: Array,
    steady: Array,
    back: NDArray[np.bool_],
) -> None:
    """Fill ``states`` (n,) and ``longest`` (n,) m, the farthest background of each beam (inf: none).

    ``steady`` (n,) m becomes the same where it is not mostly silent, ``back`` (n,) which beams show nothing but what
    had gone.

    centre, sigma, weight: (n, k) components, m; empty: (n,) weight of no echo. A range is background if it is near a
    component of the beam or of one beside it (edges jitter), foreground if it is shorter than the longest component.
    """
    n, k = centre.shape
    for i in range(n):
        far = _longest_of(centre, weight, least, i)
        longest[i] = far if far > 0.0 else np.inf
        steady[i] = longest[i] if empty[i] < _SILENT else np.inf
        back[i] = False
    for i in range(n):
        r = ranges[i]
        if np.isnan(r):
            states[i] = UNKNOWN
            continue
        if np.isinf(r):
            states[i] = NO_ECHO
            continue
        states[i] = BACKGROUND
        if _its_own(centre, sigma, weight, missing, least, sigmas, threshold, i, r):
            continue
        state = UNKNOWN
        gone = True
        lowest, highest = np.inf, 0.0
        for b in range(max(0, i - 1), min(n, i + 2)):
            for j in range(k):
                if weight[b, j] > least[b]:
                    margin = max(threshold, sigmas * sigma[b, j])
                    if abs(r - centre[b, j]) <= margin:
                        state = BACKGROUND
                        gone &= missing[b, j] > GONE_S
                    lowest = min(lowest, centre[b, j] - margin)
                    highest = max(highest, centre[b, j] + margin)
        back[i] = state == BACKGROUND and gone
        if state == UNKNOWN:
            for side in (-1, 1):
                # A slanting wall goes on where something nearer ends.
                if 0 <= i + 2 * side < n:
                    one, two = longest[i + side], longest[i + 2 * side]
                    bend = abs(one - two)
                    if bend < 0.3 and abs(r - 2.0 * one + two) < threshold + 0.6 * bend:
                        state = BACKGROUND
        if state == UNKNOWN:
            if r < longest[i]:
                # A slanting wall: between what the beams on both sides see there is nothing new.
                slanting = highest - lowest < 0.25 and lowest < r < highest
                state = BACKGROUND if slanting else FOREGROUND
            else:
                state = BEYOND
        states[i] = state


@njit(cache=True)
def _its_own(
    centre: Array,
    sigma: Array,
    weight: Array,
    missing: Array,
    least: Array,
    sigmas: float,
    threshold: float,
    i: int,
    r: float,
) -> bool:
    """Whether the range r of beam i is near a component of its own that has not gone: so it is mostly."""
    for j in range(centre.shape[1]):
        gap = abs(r - centre[i, j])
        near = gap <= threshold or gap <= sigmas * sigma[i, j]
        if near and weight[i, j] > least[i] and not missing[i, j] > GONE_S:
            return True
    return False


@njit(cache=True)
def _learn(
    ranges: Array,
    keep: NDArray[np.bool_],
    usual: float,
    slow: float,
    pull: float,
    dt: float,
    raise_after: float,
    sigmas: float,
    threshold: float,
    states: States,
    centre: Array,
    sigma: Array,
    weight: Array,
    empty: Array,
    beyond: Array,
    beyond_at: Array,
    missing: Array,
    gone_at: Array,
    seconds: float,
    times: Array,
    seen_at: Array,
) -> None:
    """Update the components in place, except of the beams in ``keep`` (n,): those show something known.

    usual: by how much this scan counts, slow: where it shows something nearer than the background; pull: by how much
    the nearest component follows. ``beyond`` (n,) s counts how long a beam has passed its background and ``beyond_at``
    (n,) m where to: then the background there has gone. ``missing`` (n, k) s is for how long beams have passed the
    place of a component since it was last seen, ``gone_at`` (n, k) when they first did. ``times`` (n, k) is how often
    each was seen, ``seen_at`` (n, k) when last, ``seconds`` the time now.
    """
    n, k = centre.shape
    for i in range(n):
        r = ranges[i]
        rate = slow if states[i] == FOREGROUND else usual
        if keep[i] or np.isnan(r):
            continue
        if np.isinf(r):
            empty[i] += rate * (1.0 - empty[i])
            for j in range(k):
                weight[i, j] *= 1.0 - rate
            continue
        floor = SIGMA_M + SIGMA_PER_M * r
        best, least = -1, 0
        nearest = np.inf
        for j in range(k):
            if weight[i, j] > 0.0:
                gap = abs(r - centre[i, j])
                if gap < max(threshold, sigmas * sigma[i, j]) and gap < nearest:
                    best, nearest = j, gap
            if weight[i, j] < weight[i, least]:
                least = j
        empty[i] *= 1.0 - rate
        for j in range(k):
            weight[i, j] *= 1.0 - rate
            if weight[i, j] > 0.0 and r > centre[i, j] + max(threshold, sigmas * sigma[i, j]):
                if missing[i, j] == 0.0:
                    gone_at[i, j] = seconds
                missing[i, j] += dt
        if best >= 0:
            if states[i] != FOREGROUND:
                missing[i, best] = 0.0
            weight[i, best] += rate
            times[i, best] += seconds - seen_at[i, best] > LATER_S
            gain = max(pull, rate)
            step = r - centre[i, best]
            centre[i, best] += gain * step
            spread = abs(step) * 1.2533  # the mean deviation of a Gaussian is 0.8 sigma
            sigma[i, best] = max(floor, sigma[i, best] + 0.5 * gain * (spread - sigma[i, best]))
        else:
            best = least
            centre[i, best], sigma[i, best], weight[i, best] = r, 2.0 * floor, rate
            missing[i, best], times[i, best] = 0.0, 1.0
        seen_at[i, best] = seconds
        if states[i] == BEYOND:
            if abs(r - beyond_at[i]) > 4.0 * threshold:
                beyond[i] = 0.0
            beyond_at[i] = r
            beyond[i] += dt
            if beyond[i] > raise_after:
                beyond[i] = 0.0
                if weight[i, best] < 0.4:
                    for j in range(k):
                        weight[i, j] *= 0.6
                    empty[i] *= 0.6
                    weight[i, best] = 0.4
        elif states[i] == BACKGROUND:
            beyond[i] = max(0.0, beyond[i] - dt)


class Background:
    """The background of one sensor with n beams. Learned with people present: who only passes weighs little."""

    def __init__(self, n: int, step_rad: float, settings: FloorSettings) -> None:
        self._settings, self._step = settings, abs(step_rad)
        self.centre = np.zeros((n, _COMPONENTS))
        self.sigma = np.full((n, _COMPONENTS), 0.01)
        self.weight = np.zeros((n, _COMPONENTS))
        self.empty = np.zeros(n)
        self.beyond = np.zeros(n)
        self.beyond_at = np.zeros(n)
        self.states = np.zeros(n, np.int8)
        self.longest, self.steady = np.full(n, np.inf), np.full(n, np.inf)
        self.missing, self.gone_at = np.zeros((n, _COMPONENTS)), np.zeros((n, _COMPONENTS))
        self.times, self.seen_at = np.zeros((n, _COMPONENTS)), np.zeros((n, _COMPONENTS))
        self.seconds = 0.0
        self._back = np.zeros(n, np.bool_)
        self._least = np.full(n, _WEIGHT)
        self._scans = 0

    @property
    def ready(self) -> bool:
        """Whether something can be called foreground."""
        return self.seconds >= self._settings.start_s

    @property
    def learned(self) -> bool:
        """Whether what stands still is known by now."""
        return self.seconds >= self._settings.learn_s

    def classify(self, ranges: Array) -> States:
        """What each beam shows, (n,); the array is reused."""
        # At first little has been seen: only what was there most of the time counts.
        young = max(0.0, 1.0 - self.seconds / self._settings.learn_s)
        seldom = min(FAINT, 0.5 / max(self._scans, 1)) if young else FAINT
        believe(
            self.centre,
            self.weight,
            self.empty,
            self.times,
            _WEIGHT + 0.34 * young,
            seldom,
            self._step,
            self._least,
        )
        _classify(
            ranges,
            self.centre,
            self.sigma,
            self.weight,
            self.empty,
            self.missing,
            self._least,
            self._settings.sigmas,
            self._settings.threshold_m,
            self.states,
            self.longest,
            self.steady,
            self._back,
        )
        whole(ranges, self.centre, self.weight, self.missing, FOREGROUND, self.states, self._back)
        return self.states

    def learn(self, ranges: Array, keep: NDArray[np.bool_], dt: float) -> None:
        """Learn from a classified scan, ``dt`` seconds after the last, all but the beams in ``keep``."""
        self._scans += 1
        dt = min(dt, 1.0)
        self.seconds += dt
        rate = max(1.0 / self._scans, dt / self._settings.forget_s)
        slow = dt / self._settings.forget_s
        if not self.learned:
            rate = slow = 1.0 / self._scans
        _learn(
            ranges,
            keep,
            rate,
            slow,
            min(1.0, dt / self._settings.drift_s),
            dt,
            self._settings.raise_s,
            self._settings.sigmas,
            self._settings.threshold_m,
            self.states,
            self.centre,
            self.sigma,
            self.weight,
            self.empty,
            self.beyond,
            self.beyond_at,
            self.missing,
            self.gone_at,
            self.seconds,
            self.times,
            self.seen_at,
        )

    def points(self, angles: Array) -> Array:
        """(k, 2) m before the sensor: where the beams of these ``angles`` (n,) rad end that mostly end at one place."""
        best = self.weight.argmax(axis=1)
        beams = np.flatnonzero(self.weight.max(axis=1) > _MOSTLY)
        ranges = self.centre[beams, best[beams]]
        return np.stack([ranges * np.cos(angles[beams]), ranges * np.sin(angles[beams])], axis=1)

    def seen_past(self, first: int, last: int, range_m: float) -> float:
        """When (in its ``seconds``) beams from ``first`` to ``last`` ended beyond the range last; inf: none tells."""
        beams = slice(first, last + 1)
        beyond = (self.weight[beams] > 0.0) & (self.centre[beams] > range_m + _BEYOND_M)
        past = np.where(beyond, self.seen_at[beams], -np.inf).max(axis=1)
        # At the edges beams pass beside what stands there.
        return float(np.median(np.where(beyond.any(axis=1), past, np.inf)))

    def stretch(self, scale: float) -> None:
        """Everything is ``scale`` times as far as it was learned."""
        self.centre *= scale
        self.beyond_at *= scale
        self.longest *= scale
        self.steady *= scale

    def adopt(self, beams: NDArray[np.int64], ranges: Array, share: float = 0.3) -> None:
        """Something that stands there belongs to the room: (m,) beams and their ranges (m,) m."""
        adopt(
            beams,
            ranges,
            share,
            self._settings.threshold_m,
            self.centre,
            self.sigma,
            self.weight,
            self.empty,
            self.missing,
            self.times,
            self.seen_at,
            self.seconds,
        )

    # --- across restarts

    _ARRAYS = ("centre", "sigma", "weight", "empty", "beyond", "beyond_at", "missing", "gone_at", "times", "seen_at")

    def save(self) -> tuple[dict[str, Array], dict[str, float]]:
        """Arrays and numbers to keep."""
        return {name: getattr(self, name) for name in self._ARRAYS}, {"seconds": self.seconds, "scans": self._scans}

    def restore(self, arrays: dict[str, Array], numbers: dict[str, float]) -> None:
        """Go on from what was kept."""
        for name in self._ARRAYS:
            if arrays[name].shape != getattr(self, name).shape:
                raise ValueError(f"the saved background ({name}) is of a sensor with other beams")
            setattr(self, name, arrays[name].astype(np.float64))
        self.seconds, self._scans = float(numbers["seconds"]), int(numbers["scans"])
