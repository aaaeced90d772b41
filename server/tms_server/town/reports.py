"""What agents report beside events: zone reads, poses of their own mover, the state of their device."""

from __future__ import annotations

from tms_schemas.events import LabelMoved, MoverEntered, TagMissed, TagObserved
from tms_schemas.observation import AgentState, PoseReport, RawRead
from tms_schemas.rooms import Zone
from tms_server.town.folding import Folding
from tms_server.town.geometry import inside


def apply(fold: Folding, report: RawRead | PoseReport | AgentState) -> None:
    match report:
        case RawRead() as read:
            _zone_read(fold, read)
        case PoseReport() as pose:
            _pose(fold, pose)
        case AgentState(state=state):
            agent = fold.record.agent
            fold.state.agents[agent] = fold.state.agents[agent]._replace(state=state)


def _zone_read(fold: Folding, read: RawRead) -> None:
    """Expand the antenna's zone to the labels in it now: the tag is at one of them, or none of its tags was seen."""
    zone = _zone(fold, read.zone)
    if zone is None:
        fold.note("unknown_zone", f"agent {fold.record.agent} has no zone {read.zone!r} in this room")
        return
    within = [name for name, info in fold.state.labels.items() if not info.ghost and inside(info.xy, zone.polygon)]
    if read.tag is not None:
        fold.read(read.tag, None)
        if within:
            fold.fold(TagObserved(labels=within, tag=read.tag))
        elif read.tag in fold.state.names:
            fold.note("empty_zone", f"{read.tag} was read in zone {read.zone!r}, where there is no label")
        return
    if within:
        for tag, places in fold.engine.marginals().items():
            if any(name in places for name in within):
                fold.fold(TagMissed(labels=within, tag=tag))


def _zone(fold: Folding, zone_id: str) -> Zone | None:
    room, agent = fold.state.room, fold.record.agent
    sensors = room.sensors if room is not None else []
    zones = (zone for sensor in sensors if sensor.agent == agent for zone in sensor.zones)
    return next((zone for zone in zones if zone.id == zone_id), None)


def _pose(fold: Folding, report: PoseReport) -> None:
    """The agent's own mover is there, whether or not it was announced."""
    x, y, theta = report.pose
    if report.label in fold.state.labels:
        fold.fold(LabelMoved(label=report.label, xy=(x, y)))
    else:
        fold.fold(MoverEntered(label=report.label, xy=(x, y)))
    info = fold.state.active(report.label)
    if info is not None:
        fold.state.labels[report.label] = info._replace(theta=theta)
