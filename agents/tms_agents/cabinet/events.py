"""What the estimator tells: frozen records in the cabinet's frame (metres, grams, seconds of the sensor)."""

from __future__ import annotations

from dataclasses import dataclass

from tms_agents.cabinet.geometry import Covariance


@dataclass(frozen=True)
class Stay:
    """One thing on the board from the moment it was put there until it is lifted; the id is never used again."""

    id: int
    xy: tuple[float, float]
    cov: Covariance
    weight_g: float
    weight_sd_g: float
    tag: str | None
    since: float


@dataclass(frozen=True)
class Appeared:
    """A thing was put on the board.

    ``pressed``: a hand may still press on it, so that its weight is only a guess; ``Weighed`` follows if it stays.
    """

    t: float
    stay: int
    xy: tuple[float, float]
    cov: Covariance
    weight_g: float
    weight_sd_g: float
    pressed: bool = False


@dataclass(frozen=True)
class Weighed:
    """What a thing weighs that was told while a hand might still press on it; once."""

    t: float
    stay: int
    weight_g: float
    weight_sd_g: float


@dataclass(frozen=True)
class Vanished:
    """A thing was lifted from the board; its stay is over."""

    t: float
    stay: int
    weight_g: float
    weight_sd_g: float


@dataclass(frozen=True)
class Moved:
    """A thing was slid, or a better estimate of its position differs clearly from the one told before."""

    t: float
    stay: int
    xy: tuple[float, float]
    cov: Covariance


@dataclass(frozen=True)
class Identified:
    """The tag of a stay is known."""

    t: float
    stay: int
    tag: str


@dataclass(frozen=True)
class LoadChanged:
    """One load step over several stays whose shares are not known: their own weights are only guesses.

    Positive after the ``Appeared`` of the stays, negative before their ``Vanished``.
    """

    t: float
    stays: tuple[int, ...]
    weight_g: float
    weight_sd_g: float


@dataclass(frozen=True)
class ZoneRead:
    """A tag that belongs to no stay is (None: nothing is any more) in an antenna's zone; once per visit."""

    t: float
    zone: str
    tag: str | None


CabinetEvent = Appeared | Weighed | Vanished | Moved | Identified | LoadChanged | ZoneRead
