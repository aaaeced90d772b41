"""The floor estimator: scans of lasers just above the floor in, who walks there and what lies there out. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tms_agents.floor.association.association import Association
from tms_agents.floor.events import FloorEvent, FloorLabel
from tms_agents.floor.feet.brightness import measure, note
from tms_agents.floor.feet.build import count_shoes, legs, only_legs
from tms_agents.floor.feet.left_feet import has_left, take_back
from tms_agents.floor.feet.own_feet import exchange
from tms_agents.floor.feet.prints import attend, follow
from tms_agents.floor.feet.putting import count_feet, set_aside
from tms_agents.floor.feet.strays import release
from tms_agents.floor.movers.coverage import Coverage
from tms_agents.floor.movers.tracks import Tracks
from tms_agents.floor.objects.objects import Objects
from tms_agents.floor.objects.patience import brings
from tms_agents.floor.objects.ripening import OBJECT, joins
from tms_agents.floor.robots.footprints import Footprints
from tms_agents.floor.robots.recognizing import gather, recognize, sizes
from tms_agents.floor.scan.background import FOREGROUND
from tms_agents.floor.scan.clustered import ClusteredScan
from tms_agents.floor.scan.dark import dark_width
from tms_agents.floor.scan.freespace import LOOK, claim, guard, look
from tms_agents.floor.scan.furniture import ADOPTED, LOOKS, MOVED, Furniture, Piece
from tms_agents.floor.scan.fusion import Extrinsics
from tms_agents.floor.scan.masks import Area, Masks
from tms_agents.floor.scan.segmentation import backed
from tms_agents.floor.scan.view import View
from tms_agents.floor.settings import FloorSettings, Pose, Scene, Sensor
from tms_agents.floor.state import PRINT, THING, empty, pack, unpack

Array = NDArray[np.float64]

#: As many as there can be at once.
_BODIES, _PRINTS, _THINGS = 32, 192, 128
_DARK = np.zeros(0)
#: In a door somebody may wait for so long (s); for so long if somebody known had been there, who may have put it there.
_WAITS_S, _STOPS_S = 25.0, 8.0
#: So long (s) after the room was learned, slivers of it are no things.
_UNSETTLED_S = 30.0
#: So wide (m) is no edge of anybody.
_EDGE_M = 0.12
#: What brought nothing so lately (s) is black or glossy; so wide (m) it is no thing that somebody puts down.
_MUTE_S, _DARK_M = 1.0, 0.3
#: Of saved states; 25: where somebody went on two feet last.
_FORMAT = 26


class FloorEstimator:
    """Several lasers of one room; room frame, metres, seconds. Scans of a sensor come in the order of their times."""

    def __init__(
        self,
        sensors: Mapping[str, Sensor],
        settings: FloorSettings | None = None,
        scene: Scene | None = None,
    ) -> None:
        self._settings, self._scene = settings or FloorSettings(), scene or Scene()
        self._views = {
            name: View(index, sensor, self._settings, tuple(self._scene.mirrors))
            for index, (name, sensor) in enumerate(sensors.items())
        }
        self._masks = Masks(self._scene.region, self._scene.masks, self._scene.gates)
        self._gates = Area(self._scene.gates)
        self._prints = empty(PRINT, _PRINTS)
        self._association = Association(_BODIES, _PRINTS, self._scene.seats)
        self._shoes = legs()
        self._tracks = Tracks(self._association, self._settings, self._scene)
        self._coverage = Coverage(self._scene, self._tracks.absent.doors)
        self._objects = Objects(empty(THING, _THINGS), self._settings)
        self._furniture = Furniture()
        self._footprints = Footprints(self._scene.robots, self._gates, self._association)
        self._robots = sizes(self._scene.robots)
        told = [sensor.range_scale is not None for sensor in sensors.values()]
        self._extrinsics = Extrinsics([sensor.pose for sensor in sensors.values()], told)
        self._looks = np.zeros(_THINGS, LOOK)
        self._of = np.zeros(256, np.int64)
        self._marks = np.zeros((256, 4))
        self._labels = 0
        self._t = -np.inf

    def scan(self, sensor: str, t: float, ranges: Array, intensities: Array | None = None) -> list[FloorEvent]:
        """Take one scan, (n,) m, whose first beam was measured at ``t``: what happened, in the order told to a server.

        Raises:
            ValueError: an unknown sensor, another number of beams, or a time before the sensor's last.
        """
        view = self._views.get(sensor)
        if view is None:
            raise ValueError(f"there is no floor sensor {sensor!r}")
        if np.shape(ranges) != (view.n,):
            raise ValueError(f"a scan of {sensor!r} has {view.n} ranges, not {np.shape(ranges)}")
        if view.last is not None and t < view.last:
            raise ValueError(f"the scans of {sensor!r} go back in time")
        dt = 0.0 if view.last is None else min(t - view.last, 1.0)
        view.last = t
        t = self._t = max(t, self._t)
        view.take(ranges)
        background = view.background
        states = background.classify(view.ranges)
        view.claimed[:] = False
        events: list[FloorEvent] = []
        if background.ready:
            if view.range_scale is None and (fit := view.compare(self._scene.region)) is not None:
                self._extrinsics.place(view.index, fit.pose)
            events = self._understand(view, states, t, dt, _lights(intensities, view.n))
        background.learn(view.ranges, view.claimed, dt)
        self._coverage.look(list(self._views.values()), t, dt)
        return events

    def labels(self) -> list[FloorLabel]:
        """Everything on the floor now, oldest label first; without those who are ``awaited``."""
        return sorted(self._tracks.labels(self._t) + self._objects.labels(), key=lambda label: label.id)

    def awaited(self) -> list[FloorLabel]:
        """Movers who must be in the room and may be anywhere in it, about where each was seen last."""
        return self._tracks.awaited(self._t)

    def poses(self) -> dict[str, Pose]:
        """Where the sensors are: as given, or as the walls tell, refined by what several of them have seen at once."""
        return {name: self._extrinsics.pose(view.index) for name, view in self._views.items()}

    def range_scales(self) -> dict[str, float]:
        """What each sensor measures times this is how far it is: as given, as the walls tell, as other sensors tell."""
        return {name: view.scale for name, view in self._views.items()}

    def _understand(self, view: View, states: NDArray[np.int8], t: float, dt: float, lights: Array) -> list[FloorEvent]:
        bodies, prints = self._association.bodies, self._prints
        objects = self._objects
        look(
            objects.things,
            view.ranges,
            states,
            view.background.empty,
            view.background.longest,
            view.rays,
            view.ways,
            view.pose,
            view.first,
            view.step,
            view.claimed,
            view.index,
            self._looks,
        )
        known = view.background.longest, view.background.steady
        clusters = self._masks(view.segment(view.ranges, states, view.claimed, *known, view.rays))
        if not view.background.learned:
            clusters = clusters[: backed(clusters)]
        clusters = clusters[: self._footprints.step(view, clusters, t, self._pieces)]
        if self._tracks.flickering.places:
            clusters = clusters[: self._tracks.flickering.step(view, clusters, bodies, t)]
        clusters = clusters[: gather(clusters, bodies, self._robots[1], t)]
        of = self._of[: clusters.size]
        follow(clusters, of, prints, view.index, t, view.sight)
        feet = set_aside(clusters, of, prints, bodies, self._settings.object_width_m, t)
        marks = self._marks[: clusters.size]
        increment_s = view.sensor.sweep.time_increment_s
        measure(clusters, view.ranges, lights, increment_s, self._association.scattered, marks)
        note(prints, clusters, of, marks)
        somebodys = np.zeros(clusters.size, np.bool_)
        seen = ClusteredScan(clusters[:feet], of[:feet], marks[:feet], prints, t)
        somebodys[:feet] = self._association.step(seen, view.sight)
        bodies = self._association.bodies
        count_shoes(bodies, clusters[:feet], of[:feet], t, self._shoes)
        self._association.agree(self._shoes)
        self._association.mark()
        if recognize(bodies, *self._robots):
            self._association.decide_changed()
        attend(prints, bodies, t, dt, self._association.scattered, self._shoes)
        scattered = self._association.scattered
        mended = exchange(bodies, prints, t, scattered) + release(bodies, prints, t, self._shoes, view.sight)
        if mended + take_back(bodies, prints, t, scattered):
            self._association.decide_changed()
        count_feet(prints, bodies, t, dt)
        if len(self._views) > 1 and self._extrinsics.see(view.index, clusters, of, prints, t):
            for other in self._views.values():
                other.move(self._extrinsics.pose(other.index))
                other.refine(self._extrinsics.scale(other.index))
        vanished = objects.weigh(self._looks, bodies, t, dt)
        self._tracks.strides.add(objects.walked, t)
        movers = self._tracks.review(
            t,
            dt,
            view.sight,
            self._new_label,
            lambda body: self._furniture.was(body, float(body["far"]), self._pieces()),
            lambda body: self._furniture.misses(float(body["width"]), float(body["rest_at"]), self._pieces()),
            learned=view.background.learned,
            legs=only_legs(self._shoes),
        )
        self._prints["whose"][self._tracks.no_feet] = -1
        self._prints["revealed"][self._tracks.furniture] = MOVED
        appeared: list[FloorEvent] = []
        if view.background.learned:
            intact = joins(prints, bodies, t) and not self._furniture.lacks(self._pieces())
            for index, kind in objects.ripe(prints, bodies, t, scattered, intact):
                appeared += self._settle(index, kind, t)
        self._association.settle()
        self._protect(view, clusters, of, somebodys)
        return vanished + movers + appeared

    def _pieces(self) -> list[Piece]:
        # Of the room that a laser has not learned yet whoever stood there has gone, and explains what was put down.
        learned = [view for view in self._views.values() if view.background.learned]
        return [piece for view in learned or self._views.values() for piece in self._furniture.pieces(view)]

    def _settle(self, index: int, kind: int, t: float) -> list[FloorEvent]:
        """A print rests: it is an object or furniture, or somebody who is waited for stands on it."""
        q = self._prints[index]
        x, y = float(q["x"]), float(q["y"])
        if self._masks.outside(x, y) or (kind == OBJECT and self._objects.at(q)):
            return []
        waits_s = _STOPS_S if brings(q, self._tracks.bodies) else _WAITS_S
        waits = kind == OBJECT and not q["given"] and t - q["rested"] < waits_s and self._gates.distance(x, y) == 0.0
        if waits and not has_left(q, self._tracks.bodies):
            return []
        if kind != OBJECT:
            q["revealed"] = LOOKS
            return []
        started = self._known_s(q)
        known = t - q["first"] > started - self._settings.learn_s
        # Who has stood there all the time was learned with the room, and shows an edge of himself when he shifts.
        edge = q["width"] < _EDGE_M or q["whole"] < 0.8 * q["hits"]
        sliver = (q["attached"] > 0.02 and edge) or (q["beams"] < 2.0 and not q["given"])
        unsettled = sliver and started < self._settings.learn_s + _UNSETTLED_S
        if unsettled:
            return []
        if back := self._tracks.turns_up(self._prints, index, t):
            return back
        if known or self._furniture.explains(q, self._prints, self._pieces(), t, self._empty_until(q, t)):
            q["revealed"] = MOVED
            return []
        if t - q["silent"] < _MUTE_S and self._dark_width(q) > _DARK_M:
            q["revealed"] = LOOKS
            return []
        born = self._objects.born(index, self._prints, self._tracks.bodies, self._new_label, t)
        if born:
            self._association.lift(index)
        return born

    def _empty_until(self, q: Any, t: float) -> float:
        """When the place of the print was last seen to be empty; it came to rest there then, or unseen, later."""
        view, beams = self._met(q)
        past = view.background.seen_past(*beams, float(q["near"])) + t - view.background.seconds
        return min(past, float(q["rested"]))

    def _known_s(self, q: Any) -> float:
        """For how long (s) one of the sensors has looked where the print is: the one that knows the place best.

        Others may be covered, or have begun late: what they have not learned yet is not new.
        """
        met, x, y = self._met(q)[0], float(q["x"]), float(q["y"])
        return max(view.background.seconds for view in self._views.values() if view is met or view.overlooks(x, y))

    def _dark_width(self, q: Any) -> float:
        """How wide (m) that is of which the sensor that has met the print last sees a part: black or glossy."""
        view, beams = self._met(q)
        return float(dark_width(*beams, float(q["near"]), view.ranges, view.background.longest, view.step))

    def _met(self, q: Any) -> tuple[View, tuple[int, int]]:
        """The sensor that has met the print last, and from which to which beam."""
        view = next(view for view in self._views.values() if view.index == q["sensor"])
        return view, (int(q["first_beam"]), int(q["last_beam"]))

    def _protect(self, view: View, clusters: Any, of: NDArray[np.int64], somebodys: NDArray[np.bool_]) -> None:
        """What is somebody or something is not learned as background; furniture is, at once."""
        if not view.background.learned:
            view.claimed[:] = False
            return
        k = 0
        while (k := claim(clusters, of, self._prints, somebodys, k, view.claimed)) < clusters.size:
            span = np.arange(int(clusters["first"][k]), int(clusters["last"][k]) + 1)
            span = span[(view.background.states[span] == FOREGROUND) & ~view.claimed[span]]
            view.background.adopt(span, view.ranges[span], ADOPTED[self._prints["revealed"][of[k]]])
            k += 1
        guard(view.ranges, view.background.states, view.claimed)

    def _new_label(self) -> int:
        self._labels += 1
        return self._labels

    # --- across restarts

    def to_dict(self) -> dict[str, Any]:
        """Everything known, as JSON values: backgrounds, movers, objects, and the last label given."""
        return {
            "format": _FORMAT,
            "sensors": {name: view.save() for name, view in self._views.items()},
            "association": self._association.save(),
            "shoes": pack(self._shoes),
            "prints": pack(self._prints),
            **self._tracks.save(),
            **self._objects.save(),
            **self._furniture.save(),
            "footprints": self._footprints.save(),
            "extrinsics": self._extrinsics.save(),
            "labels": self._labels,
            "t": self._t if np.isfinite(self._t) else None,
        }

    @classmethod
    def from_dict(
        cls,
        state: Mapping[str, Any],
        sensors: Mapping[str, Sensor],
        settings: FloorSettings | None = None,
        scene: Scene | None = None,
    ) -> Self:
        """Go on from a saved state.

        Raises:
            ValueError: the state is damaged, of another format, or of other sensors.
        """
        if state.get("format") != _FORMAT:
            raise ValueError("the saved state of the floor estimator has a format that this version does not know")
        self = cls(sensors, settings, scene)
        try:
            if set(state["sensors"]) != set(self._views):
                raise ValueError("the saved state of the floor estimator is of other sensors")
            for name, view in self._views.items():
                view.restore(state["sensors"][name])
            self._association.restore(state["association"])
            self._shoes[:] = unpack(state["shoes"], self._shoes)
            self._prints[:] = unpack(state["prints"], self._prints)
            for part in (self._tracks, self._objects, self._furniture):
                part.restore(state)
            self._footprints.restore(state["footprints"])
            self._extrinsics.restore(state["extrinsics"])
            self._labels = int(state["labels"])
            self._t = -np.inf if state["t"] is None else float(state["t"])
        except (KeyError, TypeError) as error:
            raise ValueError(f"the saved state of the floor estimator is damaged: {error}") from None
        return self


def _lights(intensities: Array | None, n: int) -> Array:
    """Intensities (n,), or none (0,)."""
    if intensities is None or np.shape(intensities) != (n,):
        return _DARK
    lights = np.asarray(intensities, dtype=np.float64)
    back = lights[lights > 0.0]
    # Where a laser tells none, some drivers give every echo the same: that is no brightness.
    return lights if back.size and back.min() < back.max() else _DARK
