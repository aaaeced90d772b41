"""What a room knows beside the belief: labels, agents, evidence, anomalies. Small immutable rows in plain dicts."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

from tms_schemas.events import Covariance, Kind
from tms_schemas.rooms import RoomIn
from tms_server.placement import ObjectSpec
from tms_server.town.geometry import Point

#: Anomalies kept, the newest.
MOST_ANOMALIES = 200
#: Vanished labels kept that nobody announced.
MOST_UNANNOUNCED = 200


class LabelInfo(NamedTuple):
    """A label that is active, or a ghost. Times in microseconds UTC, lengths in metres, ``theta`` in radians."""

    kind: Kind
    agent: str
    xy: Point
    since: int
    updated: int
    z: float | None = None
    theta: float | None = None
    cov: Covariance | None = None
    surface: str | None = None
    #: The tag that was read last at this label.
    tag: str | None = None
    ghost: bool = False
    put_by_robot: bool = False
    #: What its sensor weighed there, grams.
    weight_g: float | None = None


class AgentInfo(NamedTuple):
    """``last``: newest time of observation, microseconds UTC; ``state`` as the agent said last."""

    last: int
    state: str = "connected"


class Evidence(NamedTuple):
    """The last direct read of one object."""

    agent: str
    seq: int
    kind: str
    label: str | None
    observed_at: int


class Fault(NamedTuple):
    """When something odd happened last."""

    seq: int
    observed_at: int


@dataclass(slots=True)
class RoomState:
    """All of a room that is not the belief. ``copy`` is shallow: the rows never change in place."""

    room: RoomIn | None = None
    names: dict[str, str] = field(default_factory=dict)
    #: Tracked objects that no reader in this room ever named: OUT, and no burden on the belief engine.
    unseen: dict[str, ObjectSpec] = field(default_factory=dict)
    labels: dict[str, LabelInfo] = field(default_factory=dict)
    agents: dict[str, AgentInfo] = field(default_factory=dict)
    evidence: dict[str, Evidence] = field(default_factory=dict)
    #: (kind, agent, detail) -> when last; the same thing again is not a new anomaly.
    anomalies: dict[tuple[str, str, str], Fault] = field(default_factory=dict)
    #: Labels that vanished before anybody announced them: (agent, label) -> when.
    unannounced: dict[tuple[str, str], Fault] = field(default_factory=dict)
    #: The newest evidence was impossible under the model.
    contradiction: bool = False

    def copy(self) -> RoomState:
        return replace(
            self,
            names=dict(self.names),
            unseen=dict(self.unseen),
            labels=dict(self.labels),
            agents=dict(self.agents),
            evidence=dict(self.evidence),
            anomalies=dict(self.anomalies),
            unannounced=dict(self.unannounced),
        )

    def active(self, label: str) -> LabelInfo | None:
        """The label, unless it is unknown or a ghost."""
        info = self.labels.get(label)
        return None if info is None or info.ghost else info

    def note(self, kind: str, agent: str, detail: str, fault: Fault) -> None:
        """Remember an anomaly; the oldest one is forgotten when there are too many."""
        key = (kind, agent, detail)
        self.anomalies.pop(key, None)
        self.anomalies[key] = fault
        if len(self.anomalies) > MOST_ANOMALIES:
            del self.anomalies[next(iter(self.anomalies))]

    def note_unannounced(self, agent: str, label: str, fault: Fault) -> None:
        self.unannounced[agent, label] = fault
        if len(self.unannounced) > MOST_UNANNOUNCED:
            del self.unannounced[next(iter(self.unannounced))]
