"""What goes into a belief filter and what comes out of one event: the types its callers use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, Self

from tms_schemas.events import Event, Kind

#: Where an object is that left the room with a mover, or was never seen.
OUT = "OUT"
#: Start of a filter, as in a scenario file: ``{"type": "known" | "list" | "uniform", ...}``.
Initial = Mapping[str, Any]


class InvalidEvent(ValueError):
    """The event names a label that is not active, one that exists already, or an impossible move.

    The state is unchanged.
    """


@dataclass(frozen=True, kw_only=True, slots=True)
class ObjectSpec:
    """A tracked object. ``weight_g`` and ``size_m`` are the registered weight (grams) and width (metres).

    ``p_read``: probability that a reader sees its tag; None takes the parameter of the same name.
    """

    id: str
    tag: str | None = None
    weight_g: float | None = None
    weight_sd_g: float = 0.0
    size_m: float | None = None
    p_read: float | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class LabelSpec:
    """A label that exists before the first event; ``xy`` in metres in the room frame."""

    id: str
    kind: Kind
    xy: tuple[float, float]


class LabelState(NamedTuple):
    """A label now. A ghost has vanished but may still hold its object (it is hidden)."""

    kind: Kind
    xy: tuple[float, float]
    ghost: bool


class Info(NamedTuple):
    """What one event did to the belief.

    Attributes:
        log_evidence: natural log of the event's total mass; 0 for idle events and contradictions.
        contradiction: the event was impossible under every hypothesis.
        changed: ids of the objects whose marginals may differ now; empty after an idle event.
        hypotheses: number of distinct placements kept.
        pruned: probability mass dropped by ``prune_eps`` at this event.
        tv_bound: certified bound of the total variation to the unpruned posterior; 1 once resampled.
        resampled: the budget was exceeded and the belief thinned.
    """

    log_evidence: float
    contradiction: bool
    changed: frozenset[str]
    hypotheses: int
    pruned: float
    tv_bound: float
    resampled: bool


class DrawKey(NamedTuple):
    """Names one event; random draws are a pure function of it, so arrival order never matters."""

    seed: int
    agent: str
    seq: int


class BeliefFilter(Protocol):
    """A belief over placements, folded event by event."""

    def apply(self, event: Event, key: DrawKey, *, p_jump: float | None = None) -> Info:
        """Fold one event. ``p_jump`` overrides the parameter for this ``label_appeared``.

        Raises:
            InvalidEvent: the state is unchanged.
        """

    def marginals(self) -> dict[str, dict[str, float]]:
        """Object id -> label id -> probability, for every object; each sums to 1."""

    def marginal(self, object_id: str) -> dict[str, float]:
        """Label id -> probability of one object. KeyError if it is unknown."""

    def to_bytes(self) -> bytes:
        """The whole state, portable and checked."""

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """The filter that ``to_bytes`` wrote. ValueError if the bytes are damaged or of another kind."""
