"""The fold: one room's state as a pure function of its log, record by record in fold order.

``RoomFold`` translates records into events of the belief engine and keeps what the engine does not: names,
positions, who owns a label, what was read last. It reads no clock, draws no number of its own and never raises on
what an agent sent; what does not fit is an anomaly.
"""

from __future__ import annotations

import logging

from tms_schemas import events
from tms_schemas.observation import AgentState, Inventory, Observation, PoseReport, RawRead
from tms_server.log.bodies import MapChanged, ObjectRemoved, RoomChanged, TrackedObject, Unreadable
from tms_server.log.record import ORIGIN, Position, Record
from tms_server.placement import OUT, DrawKey, Engine, InvalidEvent, Parameters
from tms_server.town import inventory, packing, registry, reports, sight
from tms_server.town.resolve import UnknownMover, resolved
from tms_server.town.state import AgentInfo, Evidence, Fault, LabelInfo, RoomState

_log = logging.getLogger(__name__)


class RoomFold:
    """The state of one room after every record up to ``position`` (in fold order) that it was given.

    Args:
        budget: hypotheses to keep; None means all of them.
    """

    def __init__(self, budget: int | None) -> None:
        self.state = RoomState()
        self.engine = Engine([], [], {"type": "known"}, Parameters.of(profile="live"), budget=budget)
        self.position: Position = ORIGIN
        self._record: Record | None = None
        self._parts = 0

    def apply(self, record: Record) -> None:
        """Fold the next record. Its position must be after ``self.position``."""
        self.position, self._record, self._parts = record.position, record, 0
        try:
            match record.content:
                case Unreadable(kind=kind, why=why):
                    self.note("unreadable", f"{kind}: {why}")
                case MapChanged():
                    pass  # told to viewers; the belief is not folded with it
                case TrackedObject() | ObjectRemoved() | RoomChanged() as change:
                    registry.apply(self, change)
                case observation:
                    self._observe(record, observation)
        except Exception as error:
            # A defect, and the same one at every replay: the room must not stand still for ever because of one record.
            _log.exception("record %d of room %s cannot be folded", record.offset, record.room)
            self.note("failed", f"{record.kind}: {type(error).__name__}")

    def _observe(self, record: Record, observation: Observation) -> None:
        known = self.state.agents.get(record.agent)
        self.state.agents[record.agent] = AgentInfo(record.observed_at, known.state if known else "connected")
        match observation:
            case Inventory():
                inventory.reconcile(self, observation)
            case RawRead() | PoseReport() | AgentState():
                reports.apply(self, observation)
            case event:
                self.fold(event)

    def fold(self, event: events.Event, *, p_jump: float | None = None) -> None:
        """One event of the vocabulary: give it to the engine, and keep what it says of labels and tags."""
        if isinstance(event, events.LabelVanished) and event.label not in self.state.labels:
            # Its ``appeared`` may only be late; whether it was is seen when this is asked for.
            self.state.note_unannounced(self.record.agent, event.label, self._fault())
            return
        try:
            event = resolved(event, self.state.labels)
            if sight.is_first(event, self):
                p_jump = sight.P_UNSEEN
            self._give(sight.as_content(event, self), p_jump)
        except UnknownMover as error:
            self.note("unknown_mover", f"{event.type}: {error}")
        except InvalidEvent as error:
            self.note("invalid", f"{event.type}: {error}")
        else:
            _keep(self, event)

    @property
    def record(self) -> Record:
        """The record being folded."""
        assert self._record is not None
        return self._record

    def note(self, kind: str, detail: str) -> None:
        """An anomaly of the record being folded."""
        self.state.note(kind, self.record.agent, detail, self._fault())

    def read(self, tag: str, label: str | None) -> None:
        """The record read the tag of an object: direct evidence of it."""
        record = self.record
        if tag in self.state.names:
            self.state.evidence[tag] = Evidence(record.agent, record.seq, record.kind, label, record.observed_at)

    def marginal(self, tag: str) -> dict[str, float]:
        """Label -> probability of one tracked object; KeyError where the room does not track it."""
        return {OUT: 1.0} if tag in self.state.unseen else self.engine.marginal(tag)

    def copy(self) -> RoomFold:
        """An independent fold in the same state; cheap."""
        twin = RoomFold.__new__(RoomFold)
        twin.state, twin.engine, twin.position = self.state.copy(), self.engine.copy(), self.position
        twin._record, twin._parts = None, 0
        return twin

    def to_bytes(self) -> bytes:
        """The whole state, checked; equal states give equal bytes."""
        return packing.pack(self.state, self.position, self.engine.to_bytes())

    @classmethod
    def from_bytes(cls, data: bytes) -> RoomFold:
        """What ``to_bytes`` wrote; folding on is bit-identical. ValueError if it is damaged or of another version."""
        twin = cls.__new__(cls)
        twin.state, twin.position, engine = packing.unpack(data)
        twin.engine = Engine.from_bytes(engine)
        twin._record, twin._parts = None, 0
        return twin

    def _give(self, event: events.Event, p_jump: float | None) -> None:
        record, seed = self.record, self.state.room.seed if self.state.room else 0
        # One record may become several events: each draws its own numbers.
        agent = f"{record.agent}#{self._parts}" if self._parts else record.agent
        self._parts += 1
        info = self.engine.apply(event, DrawKey(seed, agent, record.seq), p_jump=p_jump)
        if info.contradiction:
            self.note("contradiction", f"{event.type}{_of(event)} is impossible under the belief, which was kept")
        if info.contradiction or info.changed:
            self.state.contradiction = info.contradiction

    def _fault(self) -> Fault:
        return Fault(self.record.seq, self.record.observed_at)


def _of(event: events.Event) -> str:
    label = getattr(event, "label", None) or getattr(event, "to", None)
    return f" of {label}" if label else ""


def _keep(fold: RoomFold, event: events.Event) -> None:
    """What an event that the engine took says of labels and tags."""
    labels, now = fold.state.labels, fold.record.observed_at
    match event:
        case events.LabelAppeared() | events.MoverEntered():
            kind = event.kind if isinstance(event, events.LabelAppeared) else "mover"
            labels[event.label] = LabelInfo(
                kind, fold.record.agent, event.xy, now, now, event.z, None, event.cov, event.surface
            )
            fold.state.unannounced.pop((fold.record.agent, event.label), None)
            if isinstance(event, events.LabelAppeared):
                labels[event.label] = labels[event.label]._replace(weight_g=event.weight_g)
                if event.tag is not None:
                    _read_at(fold, event.tag, event.label)
        case events.LoadChange(labels=[label]) if event.weight_g > 0:
            labels[label] = labels[label]._replace(weight_g=event.weight_g, updated=now)
        case events.LabelVanished():
            labels[event.label] = labels[event.label]._replace(ghost=True, updated=now)
            states = fold.engine.labels
            for name in [name for name, info in labels.items() if info.ghost and name not in states]:
                del labels[name]
        case events.LabelMoved():
            labels[event.label] = labels[event.label]._replace(
                xy=event.xy, z=event.z, cov=event.cov, surface=event.surface, updated=now
            )
        case events.MoverLeft():
            del labels[event.label]
        case events.TagObserved():
            _read_at(fold, event.tag, event.label)
        case events.Handover(tag=str(tag)):
            fold.read(tag, event.to if isinstance(event.to, str) else None)
        case events.Correction(present=True):
            fold.read(event.tag, event.label)
        case events.Transfer():
            old = labels.pop(event.from_)
            if event.to not in labels:
                labels[event.to] = LabelInfo(
                    event.kind or old.kind, fold.record.agent, event.xy or old.xy, now, now, event.z, None, event.cov,
                    event.surface, old.tag, put_by_robot=old.kind == "robot" and event.kind != "robot",
                    weight_g=old.weight_g,
                )  # fmt: skip


def _read_at(fold: RoomFold, tag: str, label: str | None) -> None:
    fold.read(tag, label)
    if label is not None and label in fold.state.labels:
        fold.state.labels[label] = fold.state.labels[label]._replace(tag=tag, updated=fold.record.observed_at)
