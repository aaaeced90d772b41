"""Writes down what really was, as the recordings of `data/floor/sim` have it; never for an estimator."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

import numpy as np

from tms_agents.simulation.floor_world.life import Life, Stay
from tms_agents.simulation.floor_world.noise import Measured
from tms_agents.simulation.floor_world.room import Thing
from tms_agents.simulation.floor_world.shapes import Ints

#: A thing counts as seen with so many beams on it; its place as clear after so many seconds of a free view.
SEEN_BEAMS, CLEAR_S = 2, 0.5


class Witness:
    """Watches every scan of a life. ``times[name]`` are the stamps of a laser's scans, the first laser's are frames."""

    def __init__(self, life: Life) -> None:
        self._life = life
        self.times: dict[str, list[float]] = {name: [] for name in life.room.mounts}
        self._counts: dict[str, list[Ints]] = {name: [] for name in life.room.mounts}
        self._bodies: list[dict[str, tuple[float, float, float]]] = []
        self._clear: dict[int, dict[str, float]] = defaultdict(lambda: defaultdict(float))
        self._first_clear: dict[int, float] = {}
        self._frames_of = next(iter(life.room.mounts))

    def saw(self, laser: str, stamp: float, scan: Measured) -> None:
        """Call with every scan, right after it was made."""
        self.times[laser].append(stamp)
        owners = scan.owners[scan.owners >= 0]
        self._counts[laser].append(np.bincount(owners) if len(owners) else np.zeros(0, dtype=np.int64))
        if laser == self._frames_of:
            plan = self._life.plan
            self._bodies.append(
                {
                    mover.id: (*mover.xy, mover.yaw)
                    for mover in self._life.movers.values()
                    if plan.contains(mover.xy, -0.01)
                }
            )
        for i, stay in enumerate(self._life.stays):
            if stay.picked_at is not None and i not in self._first_clear and self._sees_the_place(laser, stay, scan):
                self._clear[i][laser] += self._life.room.mounts[laser].laser.period_s
                if self._clear[i][laser] >= CLEAR_S - 1e-9:
                    self._first_clear[i] = stamp

    def truth(self, name: str, seed: int, duration: float, quiet_s: float, description: str) -> dict[str, Any]:
        """The whole of it, ready for JSON."""
        life = self._life
        movers = self._movers()
        region = [[x, y] for x, y in life.plan.outline(0.01)]
        return {
            "scenario": name,
            "variant": "leg" if life.room.feet == "legs" else "floor",
            "seed": seed,
            "description": description,
            "duration": duration,
            "t_background_end": quiet_s,
            "sensors": [
                {
                    "name": mount.name,
                    "model": mount.laser.model,
                    "file": "",
                    "pose_reported": [round(v, 4) for v in mount.reported],
                    "pose_true": [round(v, 4) for v in mount.pose],
                }
                for mount in life.room.mounts.values()
            ],
            "region": region,
            "room": [[x, y] for x, y in life.plan.outline()],
            "mirrors": [[*wall.a, *wall.b] for wall in life.room.walls if wall.material.mirror],
            "furniture": self._furniture(),
            "t": [round(t, 4) for t in self.times[self._frames_of]],
            "movers": movers,
            "objects": self._objects(movers),
            "events": self._events(),
        }

    # inside

    def _sees_the_place(self, laser: str, stay: Stay, scan: Measured) -> bool:
        """Half of the beams that would meet the thing, were it still there, come back from behind its place."""
        mount, thing = self._life.room.mounts[laser], stay.thing
        dx, dy = thing.pose[0] - mount.pose[0], thing.pose[1] - mount.pose[1]
        distance = math.hypot(dx, dy)
        bearing = math.remainder(math.atan2(dy, dx) - mount.pose[2], 2 * math.pi)
        half = max(math.asin(min(1.0, thing.size / 2 / distance)), mount.laser.step / 2)
        first = math.ceil((bearing - half - mount.laser.first_angle) / mount.laser.step)
        last = math.floor((bearing + half - mount.laser.first_angle) / mount.laser.step)
        beams = scan.ranges[max(0, first) : last + 1]
        behind = np.isfinite(beams) & (beams > distance + thing.size / 2 + 0.02)
        return len(beams) > 0 and behind.sum() >= len(beams) / 2

    def _hits(self, name: str) -> dict[str, list[int]]:
        owner = self._life.room.owner(name)
        return {
            laser: [int(count[owner]) if owner < len(count) else 0 for count in counts]
            for laser, counts in self._counts.items()
        }

    def _movers(self) -> list[dict[str, Any]]:
        """One entry for each stay in the room: who comes back is somebody new."""
        times = self.times[self._frames_of]
        stays: list[tuple[str, int, int]] = []
        begun: dict[str, int] = {}
        for k, bodies in enumerate([*self._bodies, {}]):
            stays += [(name, begun.pop(name), k) for name in list(begun) if name not in bodies]
            for name in bodies:
                begun.setdefault(name, k)
        found = []
        seen: dict[str, int] = defaultdict(int)
        for name, k0, k1 in sorted(stays, key=lambda stay: stay[1]):
            number = seen[name]
            seen[name] += 1
            track = np.array([self._bodies[k][name] for k in range(k0, k1)])
            found.append(
                {
                    "id": name + ("" if number == 0 else chr(ord("a") + number)),
                    "kind": "robot" if name.startswith("r") else "person",
                    "size": list(self._life.sizes[name]) if name in self._life.sizes else None,
                    "t_enter": round(times[k0], 3),
                    "t_leave": round(times[min(k1, len(times) - 1)], 3),
                    "frames": [k0, k1],
                    "x": [round(float(v), 3) for v in track[:, 0]],
                    "y": [round(float(v), 3) for v in track[:, 1]],
                    "yaw": [round(float(v), 3) for v in track[:, 2]],
                    "hits": self._hits(name),
                }
            )
        return found

    def _objects(self, movers: list[dict[str, Any]]) -> list[dict[str, Any]]:
        def stay_of(name: str | None, t: float | None) -> str | None:
            if name is None or t is None:
                return None
            mine = [m for m in movers if m["id"] == name or m["id"][:-1] == name]
            return str(min(mine, key=lambda m: max(m["t_enter"] - t, t - m["t_leave"], 0.0))["id"]) if mine else name

        objects: dict[str, dict[str, Any]] = {}
        for i, stay in enumerate(self._life.stays):
            thing = stay.thing
            if thing.id not in objects:
                objects[thing.id] = _described(thing) | {"spans": [], "hits": self._hits(thing.id)}
            span = {
                "first_clear": _rounded(self._first_clear.get(i)),
                "x": round(thing.pose[0], 4),
                "y": round(thing.pose[1], 4),
                "yaw": round(thing.pose[2], 3),
                "t_placed": round(stay.placed_at, 3),
                "t_picked": _rounded(stay.picked_at),
                "placed_by": stay_of(stay.placed_by, stay.placed_at),
                "picked_by": stay_of(stay.picked_by, stay.picked_at),
            }
            objects[thing.id]["spans"].append(span | self._sight(objects[thing.id]["hits"], stay))
        return list(objects.values())

    def _sight(self, hits: dict[str, list[int]], stay: Stay) -> dict[str, Any]:
        """When it was first seen, how often, how long a beam met it, and from when to when (1 s or more) none did."""
        t = np.array(self.times[self._frames_of])
        most = np.zeros(len(t))
        for laser, counts in hits.items():
            nearest = np.searchsorted(self.times[laser], t).clip(0, len(counts) - 1)
            most = np.maximum(most, np.array(counts)[nearest])
        inside = (t >= stay.placed_at) & (t < (stay.picked_at if stay.picked_at is not None else math.inf))
        seen = inside & (most >= SEEN_BEAMS)
        if not seen.any():
            return {"first_visible": None, "visible_fraction": 0.0, "met_s": 0.0, "occluded": []}
        first = t[seen][0]
        times, any_hit = t[inside & (t >= first)], most[inside & (t >= first)] > 0
        occluded, begun = [], None
        for k, hit in enumerate([*any_hit, True]):
            if not hit and begun is None:
                begun = k
            if hit and begun is not None:
                end = times[min(k, len(times) - 1)]
                if end - times[begun] >= 1.0:
                    occluded.append([round(float(times[begun]), 3), round(float(end), 3)])
                begun = None
        share = float(seen.sum() / inside.sum())
        period = self._life.room.mounts[self._frames_of].laser.period_s
        return {
            "first_visible": round(float(first), 3),
            "visible_fraction": round(share, 3),
            "met_s": round(float(any_hit.sum()) * period, 3),
            "occluded": occluded,
        }

    def _furniture(self) -> list[dict[str, Any]]:
        found = []
        for piece in self._life.room.furniture.values():
            motions = [motion for motion in self._life.motions if motion.furniture == piece.id]
            poses = [{"t": 0, "pose": list(motions[0].before if motions else piece.pose)}]
            poses += [{"t": round(motion.end, 3), "pose": list(motion.after)} for motion in motions]
            found.append(
                {
                    "id": piece.id,
                    "kind": piece.kind,
                    "w": piece.width,
                    "h": piece.depth,
                    "leg_r": piece.leg_radius if piece.kind == "legs" else None,
                    "poses": poses,
                }
            )
        return found

    def _events(self) -> list[dict[str, Any]]:
        life = self._life
        events: list[dict[str, Any]] = [
            {"t": round(t, 3), "type": kind, "mover": name} for t, kind, name in life.arrivals
        ]
        events += [
            {"t": round(motion.start, 3), "type": "furniture", "id": motion.furniture, "t_end": round(motion.end, 3)}
            for motion in life.motions
        ]
        for stay in life.stays:
            x, y, _ = stay.thing.pose
            place = {"object": stay.thing.id, "x": x, "y": y}
            events.append({"t": round(stay.placed_at, 3), "type": "placed", **place, "mover": stay.placed_by})
            if stay.picked_at is not None:
                events.append({"t": round(stay.picked_at, 3), "type": "picked", **place, "mover": stay.picked_by})
        return sorted(events, key=lambda event: event["t"])


def _described(thing: Thing) -> dict[str, Any]:
    return {
        "id": thing.id,
        "size": thing.size,
        "shape": thing.shape,
        "reflectivity": round(thing.material.reflectivity, 3),
        "specular": thing.material.echo < 0.5,
    }


def _rounded(t: float | None) -> float | None:
    return None if t is None else round(t, 3)
