"""Feet under a walking body: two shoes or two ankles that take steps.

The body goes where it is told; the feet follow it by their own rules: a foot stands still, then swings to where the
body will be in the middle of its next stance. At ankle height it is seen all the time. At the height of a sole it is
seen only while it stands, the heel first and the toes last.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tms_agents.simulation.floor_world.shapes import Drawing, Material, Xy

FeetKind = Literal["legs", "prints"]
#: Below this speed (m/s) a person stands.
_STANDS = 0.12
#: How long the heel is up already, and the toes still down; how long the heel is down and the toes still up.
_ROLLS_OFF_S, _ROLLS_ON_S = 0.12, 0.07
#: Until so long before it lands a swinging foot follows what the body does.
_SETTLED_S = 0.12


@dataclass(frozen=True, slots=True)
class Build:
    """Of one person. Seconds and metres."""

    stance_s: float
    swing_s: float
    half_width: float
    ankle: float
    heel: float
    ball: float
    sole: float  # between the middles of heel and ball
    material: Material

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Build:
        """Stance 0.5 to 0.8 s; shoes of 24 to 30 cm; one pair in eight is dark and echoes less often."""
        size = rng.uniform(0.9, 1.1)
        dark = rng.random() < 0.125
        return cls(
            stance_s=rng.uniform(0.52, 0.78),
            swing_s=rng.uniform(0.36, 0.44),
            half_width=rng.uniform(0.07, 0.11),
            ankle=rng.uniform(0.042, 0.065),
            heel=0.033 * size,
            ball=0.046 * size,
            sole=0.185 * size,
            material=Material(0.15, 0.85) if dark else Material(rng.uniform(0.3, 0.8)),
        )


@dataclass(slots=True)
class Foot:
    """Where it stands, or between which prints it swings."""

    side: int  # +1 left
    xy: Xy
    yaw: float
    since: float
    target: tuple[float, float, float] | None = None
    start_s: float = 0.0
    end_s: float = 0.0
    stray: tuple[float, float, float] = (0.0, 0.0, 0.0)  # nobody sets his foot just where he means to

    def position(self, t: float) -> tuple[Xy, Xy]:
        """(place, velocity) at ``t``."""
        if self.target is None or t <= self.start_s:
            return self.xy, (0.0, 0.0)
        u = min(1.0, (t - self.start_s) / (self.end_s - self.start_s))
        way = (self.target[0] - self.xy[0], self.target[1] - self.xy[1])
        along = u * u * (3 - 2 * u)
        rate = 6 * u * (1 - u) / (self.end_s - self.start_s)
        return (
            (self.xy[0] + along * way[0], self.xy[1] + along * way[1]),
            (rate * way[0], rate * way[1]),
        )


class Walker:
    """One person's feet. Call ``step`` some fifty times a second with where the body is."""

    def __init__(self, xy: Xy, yaw: float, t: float, rng: np.random.Generator, build: Build | None = None) -> None:
        self.xy, self.yaw = xy, yaw
        self.build = build or Build.draw(rng)
        self.lifted = False  # both feet off the floor: sitting on a bed
        self.shifts_s = (3.0, 12.0)  # between two shifts of the weight
        self.lean = 0.0  # share of the sway of the body that ankles go along
        self._rng = rng
        self._velocity = (0.0, 0.0)
        self._t = t
        self._next_step_s = t
        self._shift_s = t + rng.uniform(3, 9)
        self._feet = [Foot(side, self._beside(xy, yaw, side), yaw, t - 1.0) for side in (1, -1)]

    def step(self, t: float, xy: Xy, yaw: float | None = None) -> None:
        """The body is at ``xy`` now and looks to ``yaw``, by default to where it goes."""
        dt = t - self._t
        if dt <= 0:
            return
        keep = math.exp(-dt / 0.12)
        self._velocity = (
            keep * self._velocity[0] + (1 - keep) * (xy[0] - self.xy[0]) / dt,
            keep * self._velocity[1] + (1 - keep) * (xy[1] - self.xy[1]) / dt,
        )
        speed = math.hypot(*self._velocity)
        if yaw is None and speed > _STANDS:
            yaw = math.atan2(self._velocity[1], self._velocity[0])
        self.xy, self._t = xy, t
        if yaw is not None:
            self.yaw = yaw
        for foot in self._feet:
            if foot.target is not None and t >= foot.end_s:
                foot.xy, foot.yaw, foot.since, foot.target = foot.target[:2], foot.target[2], foot.end_s, None
            elif foot.target is not None and speed > _STANDS and t < foot.end_s - _SETTLED_S:
                foot.target = self._landing(foot, foot.end_s - t, foot.target[2] if yaw is None else yaw)
        if t >= self._next_step_s:
            self._maybe_step(t, speed)

    def sit(self, lifted: bool, t: float) -> None:
        """Lift both feet off the floor, or put them down under the body."""
        if self.lifted and not lifted:
            for foot in self._feet:
                foot.xy, foot.yaw, foot.since, foot.target = (
                    self._beside(self.xy, self.yaw, foot.side),
                    self.yaw,
                    t,
                    None,
                )
        self.lifted = lifted

    def draw(self, drawing: Drawing, owner: int, t: float, kind: FeetKind) -> None:
        """What the plane of the laser meets of the feet at ``t``."""
        if self.lifted:
            return
        b = self.build
        leans = self._leans()
        for foot in self._feet:
            (x, y), velocity = foot.position(t)
            if kind == "legs":
                drawing.circle((x + leans[0], y + leans[1]), b.ankle, owner, b.material, velocity)
                continue
            if foot.target is not None and t > foot.start_s:
                continue
            c, s = math.cos(foot.yaw), math.sin(foot.yaw)
            heel = (x - b.sole / 2 * c, y - b.sole / 2 * s)
            ball = (x + b.sole / 2 * c, y + b.sole / 2 * s)
            rolls_on = t - foot.since < _ROLLS_ON_S
            rolls_off = foot.target is not None
            if rolls_on and not rolls_off:
                drawing.circle(heel, b.heel, owner, b.material)
            elif rolls_off:
                drawing.circle(ball, b.ball, owner, b.material)
            else:
                drawing.capsule(heel, b.heel, ball, b.ball, owner, b.material, (0.0, 0.0))

    def _leans(self) -> Xy:
        """How far ankles go along with the body above two feet that stand."""
        one, two = self._feet
        if self.lean == 0.0 or one.target is not None or two.target is not None:
            return (0.0, 0.0)
        off = (self.xy[0] - (one.xy[0] + two.xy[0]) / 2, self.xy[1] - (one.xy[1] + two.xy[1]) / 2)
        return (self.lean * off[0], self.lean * off[1])

    def _maybe_step(self, t: float, speed: float) -> None:
        b = self.build
        if speed > _STANDS:
            foot = min((foot for foot in self._feet if foot.target is None), key=lambda foot: self._ahead(foot.xy))
            slow = min(1.3, max(1.0, 0.75 / speed))
            self._swing(foot, t, self.xy, self.yaw, b.swing_s * slow)
            foot.target = self._landing(foot, foot.end_s - t, self.yaw)
            both = max(0.05, (b.stance_s - b.swing_s) / 2) * slow * self._rng.uniform(0.85, 1.15)
            self._next_step_s = foot.end_s + both - _ROLLS_OFF_S
            return
        if any(foot.target for foot in self._feet):
            return
        for foot in self._feet:  # stands: brings the feet together, then shifts its weight now and then
            target = self._beside(self.xy, self.yaw, foot.side)
            astray = math.dist(foot.xy, target)
            if astray > 0.12 or abs(math.remainder(foot.yaw - self.yaw, 2 * math.pi)) > 0.6:
                self._swing(foot, t, self.xy, self.yaw, b.swing_s)
                self._next_step_s = foot.end_s + 0.1
                return
        if t >= self._shift_s:
            self._shift_s = t + self._rng.uniform(*self.shifts_s)
            foot = self._feet[self._rng.integers(2)]
            near = (self.xy[0] + self._rng.normal(0, 0.025), self.xy[1] + self._rng.normal(0, 0.025))
            self._swing(foot, t, near, self.yaw + self._rng.normal(0, 0.15), 0.3)
            self._next_step_s = foot.end_s + 0.3

    def _landing(self, foot: Foot, seconds: float, yaw: float) -> tuple[float, float, float]:
        """Where the body will be in the middle of the stance that begins in so many seconds, and beside it."""
        ahead = seconds + self.build.stance_s / 2
        at = (self.xy[0] + ahead * self._velocity[0], self.xy[1] + ahead * self._velocity[1])
        x, y = self._beside(at, yaw, foot.side)
        return (x + foot.stray[0], y + foot.stray[1], yaw + foot.stray[2])

    def _swing(self, foot: Foot, t: float, body: Xy, yaw: float, seconds: float) -> None:
        x, y = self._beside(body, yaw, foot.side)
        foot.stray = (self._rng.normal(0, 0.01), self._rng.normal(0, 0.01), self._rng.normal(0, 0.06))
        foot.target = (x + foot.stray[0], y + foot.stray[1], yaw + foot.stray[2])
        foot.start_s, foot.end_s = t + _ROLLS_OFF_S, t + _ROLLS_OFF_S + seconds
        self._next_step_s = foot.end_s

    def _beside(self, body: Xy, yaw: float, side: int) -> Xy:
        w = side * self.build.half_width
        return (body[0] - w * math.sin(yaw), body[1] + w * math.cos(yaw))

    def _ahead(self, xy: Xy) -> float:
        return (xy[0] - self.xy[0]) * self._velocity[0] + (xy[1] - self.xy[1]) * self._velocity[1]
