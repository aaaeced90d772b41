"""Answers about the belief: where an object probably is, all pies of a room, labels and movers."""

from __future__ import annotations

from typing import Literal

from tms_schemas.base import Model, Pose, RoomId, Tag, UtcTime, Xy
from tms_schemas.events import Covariance, Kind

OUTSIDE = "OUT"


class PlaceProbability(Model):
    """One slice of the pie."""

    label: str
    p: float
    kind: Kind | Literal["outside"]
    xy: Xy | None = None
    z: float | None = None
    cov: Covariance | None = None
    #: furniture/surface the label lies on, where known
    furniture: str | None = None
    surface: str | None = None
    #: the agent that owns the label says nothing any more
    stale: bool = False
    #: a vanished label that may still hold its object (hidden, not gone)
    ghost: bool = False


class Share(Model):
    """Probability rolled up to one furniture, holder or room."""

    id: str
    name: str | None = None
    p: float


class BestPose(Model):
    """The most probable place with a position."""

    label: str
    p: float
    pose: Pose | None = None
    xy: Xy | None = None
    z: float | None = None
    cov: Covariance | None = None


class DirectEvidence(Model):
    """The last read of the object's own tag."""

    agent: str
    seq: int
    type: str
    label: str | None
    observed_at: UtcTime


class LocationAnswer(Model):
    """``GET /v1/objects/{tag}/location``."""

    tag: Tag
    name: str
    room: RoomId | None
    #: The time the answer speaks of (that of the newest folded observation, or ``?at=``).
    at: UtcTime | None
    #: Offset of the newest log record the answer knows.
    cursor: int
    distribution: list[PlaceProbability]
    furniture: list[Share]
    holders: list[Share]
    rooms: list[Share]
    best: BestPose | None
    entropy_bits: float
    last_direct_evidence: DirectEvidence | None
    #: Seconds from the last direct evidence to ``at``; null where there is none.
    staleness_s: float | None
    #: True where the room's newest evidence contradicts the model (the belief was kept).
    contradiction: bool = False


class ObjectPlacement(Model):
    """One pie."""

    tag: Tag
    name: str
    distribution: list[PlaceProbability]
    entropy_bits: float


class PlacementsAnswer(Model):
    room: RoomId
    at: UtcTime | None
    cursor: int
    objects: list[ObjectPlacement]


class LabelView(Model):
    """A position label that is active now (or a ghost), and what it probably holds."""

    label: str
    kind: Kind
    agent: str | None
    xy: Xy
    z: float | None = None
    theta: float | None = None
    cov: Covariance | None = None
    furniture: str | None = None
    surface: str | None = None
    since: UtcTime
    updated_at: UtcTime
    stale: bool = False
    ghost: bool = False
    #: A robot put it there and told so (drawn hollow).
    put_by_robot: bool = False
    #: What its sensor weighed there, grams.
    weight_g: float | None = None
    contents: dict[str, float] = {}


class LabelsAnswer(Model):
    room: RoomId
    at: UtcTime | None
    cursor: int
    labels: list[LabelView]


class MoverView(Model):
    """A person or robot and how many objects it holds (expected number, and per object)."""

    label: str
    agent: str | None
    xy: Xy
    theta: float | None = None
    since: UtcTime
    updated_at: UtcTime
    stale: bool = False
    expected_objects: float
    holds: dict[str, float] = {}


class MoversAnswer(Model):
    room: RoomId
    at: UtcTime | None
    cursor: int
    movers: list[MoverView]


class Anomaly(Model):
    """Something the log contains that the model did not expect: contradiction, unknown label, unknown zone."""

    kind: str
    detail: str
    agent: str
    seq: int
    observed_at: UtcTime


class AnomaliesAnswer(Model):
    room: RoomId
    cursor: int
    anomalies: list[Anomaly]
