"""Labels as places: on which furniture, held by whom, known how freshly; and distributions rolled up to them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

from tms_schemas.belief import OUTSIDE, BestPose, PlaceProbability, Share
from tms_server.town.geometry import inside
from tms_server.town.state import LabelInfo, RoomState

#: Kinds of labels that lie on furniture.
_ON_FURNITURE = ("cabinet", "table")


class Places:
    """``reference``: the instant, microseconds UTC, against which an agent's silence is judged."""

    def __init__(self, state: RoomState, *, reference: int, silent_after_us: int) -> None:
        self.reference = reference
        self._state = state
        self._silent_after_us = silent_after_us

    def distribution(self, marginal: Mapping[str, float]) -> list[PlaceProbability]:
        """Slices of a pie, the largest first; equal ones by label."""
        return [self._place(label, p) for label, p in sorted(marginal.items(), key=lambda slice: (-slice[1], slice[0]))]

    def best(self, marginal: Mapping[str, float]) -> BestPose | None:
        """The most probable place that has a position."""
        known = [(-p, label) for label, p in marginal.items() if label in self._state.labels]
        if not known:
            return None
        p, label = min(known)
        info = self._state.labels[label]
        pose = None if info.theta is None else (*info.xy, info.theta)
        return BestPose(label=label, p=-p, pose=pose, xy=info.xy, z=info.z, cov=info.cov)

    def by_furniture(self, marginal: Mapping[str, float]) -> list[Share]:
        names = {f.id: f.name for f in self._state.room.furniture} if self._state.room else {}
        shares: dict[str, float] = {}
        for label, p in marginal.items():
            info = self._state.labels.get(label)
            furniture = self.furniture(info)[0] if info else None
            if furniture is not None:
                shares[furniture] = shares.get(furniture, 0.0) + p
        return _shares(shares, names)

    def by_holder(self, marginal: Mapping[str, float]) -> list[Share]:
        shares: dict[str, float] = {}
        for label, p in marginal.items():
            holder = self.holder(label)
            if holder is not None:
                shares[holder] = shares.get(holder, 0.0) + p
        return _shares(shares, {})

    def furniture(self, info: LabelInfo) -> tuple[str | None, str | None]:
        """(furniture, surface) as the agent says; else by the polygon under the label; else by its instrument."""
        if info.surface is not None:
            furniture, _, surface = info.surface.partition("/")
            return furniture, surface or None
        if info.kind not in _ON_FURNITURE or self._state.room is None:
            return None, None
        z = 0.0 if info.z is None else info.z
        for item in self._state.room.furniture:
            if item.agent in (None, info.agent):
                levels = [plane for plane in item.surfaces if inside(info.xy, plane.polygon)]
                if levels:
                    return item.id, min(levels, key=lambda plane: abs(plane.z - z)).id
                if inside(info.xy, item.polygon):
                    return item.id, None
        own = [item.id for item in self._state.room.furniture if item.agent == info.agent]
        return (own[0], None) if len(own) == 1 and info.kind == "cabinet" else (None, None)

    def holder(self, label: str) -> str | None:
        """Who holds what is at the label: a mover itself; what a robot grips, the robot's only mover."""
        info = self._state.labels.get(label)
        if info is None or info.kind not in ("mover", "robot"):
            return None
        return label if info.kind == "mover" else self._bodies.get(info.agent, label)

    def stale(self, info: LabelInfo) -> bool:
        """The agent that owns the label says nothing any more."""
        agent = self._state.agents.get(info.agent)
        if agent is None:
            return True
        return agent.state in ("silent", "faulty") or self.reference - agent.last > self._silent_after_us

    @cached_property
    def _bodies(self) -> dict[str, str]:
        movers: dict[str, list[str]] = {}
        for name, info in self._state.labels.items():
            if info.kind == "mover":
                movers.setdefault(info.agent, []).append(name)
        return {agent: names[0] for agent, names in movers.items() if len(names) == 1}

    def _place(self, label: str, p: float) -> PlaceProbability:
        info = self._state.labels.get(label)
        if info is None:
            return PlaceProbability(label=label, p=p, kind="outside")
        furniture, surface = self.furniture(info)
        return PlaceProbability(
            label=label,
            p=p,
            kind=info.kind,
            xy=info.xy,
            z=info.z,
            cov=info.cov,
            furniture=furniture,
            surface=surface,
            stale=self.stale(info),
            ghost=info.ghost,
        )


def inside_room(marginal: Mapping[str, float]) -> float:
    """Probability of not being outside."""
    return sum(p for label, p in marginal.items() if label != OUTSIDE)


def _shares(shares: Mapping[str, float], names: Mapping[str, str]) -> list[Share]:
    ranked = sorted(shares.items(), key=lambda share: (-share[1], share[0]))
    return [Share(id=name, name=names.get(name), p=p) for name, p in ranked]
