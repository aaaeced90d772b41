"""Recordings through the estimator: what was on the floor after every scan, as fast as it goes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from tms_agents.floor import FloorEstimator, FloorEvent, FloorSettings, Scene, Sensor
from tms_agents.floor.recordings.recorded import Recorded, in_time


class Replay:
    """Several recordings are several lasers of one run."""

    def __init__(
        self, recordings: Sequence[Recorded], settings: FloorSettings | None = None, scene: Scene | None = None
    ) -> None:
        """Raises ValueError where the recordings cannot be of one run, or no estimator can use them."""
        self.recordings = list(recordings)
        self._names = _names(self.recordings)
        sensors = [Sensor(one.sweep, one.pose, one.range_scale) for one in self.recordings]
        self.estimator = FloorEstimator(dict(zip(self._names, sensors, strict=True)), settings, scene)
        self.scans = sum(map(len, self.recordings))

    def play(self) -> Iterator[tuple[str, float, int, list[FloorEvent]]]:
        """After every scan in the order of time: laser, time of its first beam, scan number, what happened."""
        for number, n in in_time(self.recordings):
            one = self.recordings[number]
            t = float(one.t[n])
            scan = one.scan(n)
            yield self._names[number], t, n, self.estimator.scan(self._names[number], t, scan.ranges, scan.intensities)

    def frames(self, progress: Callable[[int], None] = lambda done: None) -> Iterator[dict[str, Any]]:
        """The result of ``tms floor replay``: an entry per scan."""
        for done, (_, t, _, _) in enumerate(self.play(), 1):
            labels = [
                {"id": one.id, "attr": one.kind, "x": round(one.xy[0], 4), "y": round(one.xy[1], 4)}
                for one in self.estimator.labels()
            ]
            yield {"t": t, "labels": labels}
            progress(done)


class Tracks:
    """(number, mover or object, places) of every label in frames, the oldest first."""

    def __init__(self) -> None:
        self._found: dict[int, tuple[int, str, list[tuple[float, float]]]] = {}

    def add(self, frame: dict[str, Any]) -> None:
        for label in frame["labels"]:
            track = self._found.setdefault(label["id"], (label["id"], label["attr"], []))
            track[2].append((label["x"], label["y"]))

    def all(self) -> list[tuple[int, str, list[tuple[float, float]]]]:
        return list(self._found.values())


def _names(recordings: Sequence[Recorded]) -> list[str]:
    """A name of its own for each."""
    names: list[str] = []
    for one in recordings:
        name, n = one.name, 2
        while name in names:
            name, n = f"{one.name} {n}", n + 1
        names.append(name)
    return names
