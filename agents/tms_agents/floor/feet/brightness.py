"""How brightly legs and shoes echo: what tells people apart where their ways do not."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.build import SURE, joined
from tms_agents.floor.feet.person import is_person
from tms_agents.floor.norm import norm

Array = NDArray[np.float64]

#: The light that comes back falls with the range by this power (Kyushu University, `irvs/ros_tms`, tms_ss_fss).
_FALL = 0.287
#: Standard deviations of the logarithm: sides and seams of one shoe, one beam, and people in general; at first.
PATCHES, _BEAM, _PEOPLE = 0.12, 0.15, 0.4
#: What is known of somebody never counts as better than this many sightings; the least that tell anything.
_MEMORY, _LEAST = 40, 4
#: So many sightings make how somebody looks of late, by which an exchange of names is noticed, and his own look.
_LATELY, _LIFE = 20, 1200
#: Scans of one foot resemble each other: each tells so much only, more where shoes are even, since what is left then
#: is the noise of beams, new in every scan; and nothing tells more than so many deviations.
_SHARE, _EVEN, _FAR = 0.5, 0.35, 3.5
#: Standard deviation of somebody's look as he turns, at first; what was expected counts like so many sightings, and
#: never more than so many are remembered; nothing is known better than this (share of what was expected, deviation).
_TURNS, _PRIOR, _LONG = 0.08, 40.0, 3000.0
_BEST, _STEADY = 0.1, 0.03
#: Whose shoes were seen so often has a look; somebody else so near (m) may be mistaken for him.
_KNOWN, _ALONE_M = 120, 0.8
#: A print that was seen so often is known, and as bright as somebody's feet up to so many standard deviations.
_OFTEN, ALIKE = 5, 2.5
#: What differs in brightness from somebody's feet by so many standard deviations is none of them.
STRANGE = 4.0


def expected() -> Array:
    """How brightness scatters before anybody was seen, as `scatter` learns it."""
    return np.array([1.0, _TURNS**2, _PRIOR])


@njit(cache=True)
def measure(
    clusters: Any, ranges: Array, intensities: Array, increment_s: float, scattered: Array, marks: Array
) -> None:
    """Fill ``marks`` (m, 4): logarithm of the brightness of each cluster at one metre (NaN: unknown), its variance,
    when it was seen, s into the sweep, and how much one scan tells.

    ``intensities`` (n,) in any unit that grows in proportion to the light; empty where the sensor gives none.
    ``scattered`` (3,) is what `scatter` has learned.
    """
    for k in range(clusters.size):
        c = clusters[k]
        marks[k, 0], marks[k, 1] = np.nan, 1.0
        marks[k, 2] = 0.5 * increment_s * (c.first + c.last)
        marks[k, 3] = _SHARE + _EVEN * max(1.0 - scattered[0], 0.0)
        if intensities.size == 0:
            continue
        total, best, count = 0.0, -np.inf, 0
        for i in range(c.first, c.last + 1):
            r, light = ranges[i], intensities[i]
            if np.isfinite(r) and light > 0.0 and abs(r - c.near) < 0.15:
                value = np.log(light) + _FALL * np.log(max(r, 0.3))
                total += value
                best = max(best, value)
                count += 1
        if count > 0:
            marks[k, 0] = total / count
            marks[k, 1] = scattered[0] * (PATCHES**2 + _BEAM**2 / count)


@njit(cache=True)
def note(prints: Any, clusters: Any, of: NDArray[np.int64], marks: Array) -> None:
    """Remember how bright each of ``prints`` is, from the ``marks`` (m, 4) of the clusters (m,) ``of`` (m,) them."""
    for k in range(clusters.size):
        if of[k] < 0:
            continue
        q = prints[of[k]]
        if q.hits == 1:
            q.shine_n = 0
        # Somebody else's foot is beside it.
        both = q.hits > _OFTEN and joined(clusters[k], q)
        if (not clusters[k].cut or clusters[k].n > 1) and not both and not np.isnan(marks[k, 0]):
            q.shine_n = min(q.shine_n + 1, _MEMORY)
            q.shine += (marks[k, 0] - q.shine) / q.shine_n


@njit(cache=True)
def strangeness(body: Any, q: Any, scattered: Array) -> float:
    """How many standard deviations the print differs in brightness from the feet of the body; NaN: who knows."""
    if body.own_n < _KNOWN or q.shine_n < _OFTEN:
        return float(np.nan)
    return float(abs(q.shine - body.own) / np.sqrt(scattered[1] + scattered[0] * PATCHES**2))


@njit(cache=True)
def alike(body: Any, q: Any, scattered: Array) -> bool:
    """Whether the print is as bright as the feet of the body, as far as is known of both."""
    return bool(strangeness(body, q, scattered) < ALIKE)


@njit(cache=True)
def unlike(body: Any, mark: Array) -> float:
    """Negative log likelihood ratio, of one scan, of a brightness (`measure`, (4,)) at this body or at anybody."""
    value, variance = mark[0], mark[1]
    if np.isnan(value) or body.shine_n < _LEAST:
        return 0.0
    variance *= 1.0 + 1.0 / body.shine_n
    off = min((value - body.shine) ** 2 / variance, _FAR**2)
    return float(mark[3] * (0.5 * off + 0.5 * np.log(variance / (_PEOPLE**2 + variance))))


@njit(cache=True)
def learn(body: Any, value: float) -> None:
    """The body was seen with this brightness."""
    if np.isnan(value):
        return
    body.shine_n = min(body.shine_n + 1, _MEMORY)
    body.shine += (value - body.shine) / body.shine_n
    body.look_n = min(body.look_n + 1, _LATELY)
    body.look += (value - body.look) / body.look_n
    if body.sure >= SURE:
        body.own_n = min(body.own_n + 1, _LIFE)
        body.own += (value - body.own) / body.own_n


@njit(cache=True)
def scatter(bodies: Any, clusters: Any, of: NDArray[np.int64], marks: Array, t: float, scattered: Array) -> None:
    """Learn from those whom nobody is beside how much brightness scatters from sighting to sighting and as they turn.

    ``scattered`` (3,): the variance of a sighting, in units of what is expected, of a look, and how much is known.
    """
    for b in range(bodies.size):
        body = bodies[b]
        if not is_person(body) or body.seen < t or body.shine_n < _MEMORY:
            continue
        alone = body.sure >= SURE
        for o in range(bodies.size):
            other = bodies[o]
            near = o != b and other.used and norm(other.x - body.x, other.y - body.y) < _ALONE_M
            alone = alone and not near
        if not alone:
            continue
        for i in range(clusters.size):
            mine = of[i] >= 0 and (body.a_print == of[i] or body.b_print == of[i])
            if not mine or clusters[i].cut or np.isnan(marks[i, 0]):
                continue
            expected_variance = marks[i, 1] / scattered[0]
            off = (marks[i, 0] - body.shine) ** 2 / expected_variance
            gain = 1.0 / scattered[2]
            scattered[0] += gain * (min(off, _FAR**2 * scattered[0]) - scattered[0])
            scattered[0] = max(scattered[0], _BEST)
            if body.own_n >= _KNOWN:
                off = (body.shine - body.own) ** 2
                scattered[1] += gain * (min(off, _FAR**2 * scattered[1]) - scattered[1])
                scattered[1] = max(scattered[1], _STEADY**2)
            scattered[2] = min(scattered[2] + 1.0, _LONG)
