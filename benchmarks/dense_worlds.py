"""Crowded rooms for the belief engine: many objects, several people who stand close, few identities.

People take things from cabinets and the floor, and put them on the floor (no identity) or into cabinets (tags are
sometimes missed, weights are coarse). With 30 objects, 4 people and 60 object events the exact posterior has up to
millions of hypotheses; the benchmark keeps the worlds with tens of thousands.
"""

from __future__ import annotations

import math
from random import Random
from typing import Any

CABINETS = ((0.5, 4.5), (5.5, 4.5), (5.5, 0.5))


class DenseWorld:
    """One simulated room; ``scenario()`` is its event file. Everything follows from the seed."""

    def __init__(
        self, seed: int, *, objects: int = 30, people: int = 4, events: int = 60, in_play: int | None = None
    ) -> None:
        self._rnd = Random(f"dense world {seed}")
        self._seed, self._count, self._object_events = seed, 0, events
        names = [str(i) for i in range(objects)]
        self._objects: list[dict[str, Any]] = [
            {
                "id": name,
                "tag": f"T{name}",
                "weight_g": 60 + 40 * self._rnd.randrange(8),
                "weight_sd_g": 10,
                "size_m": 0.06 + 0.02 * self._rnd.randrange(4),
            }
            for name in names
        ]
        self._at: dict[str, str] = {}
        self._labels: list[dict[str, Any]] = []
        self._xy: dict[str, tuple[float, float]] = {}
        for i, name in enumerate(names):
            x, y = CABINETS[i % len(CABINETS)]
            self._at[name] = self._label("cabinet", (x + 0.03 * (i // 3), y), start=True)
        self._people = [self._label("mover", self._spot(), start=True) for _ in range(people)]
        self._start = dict(self._at)
        self._movable = set(names if in_play is None else names[:in_play])
        self._events: list[dict[str, Any]] = []

    def scenario(self) -> dict[str, Any]:
        """Play the story; a document of format ``placement-events/1``."""
        done = 0
        while done < self._object_events:
            done += self._act()
        return {
            "format": "placement-events/1",
            "name": f"dense{self._seed}",
            "params": {
                "gate_m": 1.2,
                "alpha": {"cabinet": 1.0},
                "weight_sd_g": 15.0,
                "p_read": 0.8,
                "p_handover": 0.05,
                "prune_eps": 1e-13,
            },
            "objects": self._objects,
            "labels": self._labels,
            "initial": {"type": "known", "placement": self._start},
            "events": self._events,
        }

    def _act(self) -> int:
        """Somebody walks somewhere and perhaps moves a thing; the number of object events."""
        rnd = self._rnd
        who = rnd.choice(self._people)
        held = [o for o, at in self._at.items() if at == who]
        shelf = [o for o, at in self._at.items() if at not in self._people and o in self._movable]
        if held and (rnd.random() < 0.4 + 0.15 * len(held) or not shelf):
            return self._put(who, rnd.choice(held))
        if shelf:
            return self._take(who, rnd.choice(shelf))
        return 0

    def _take(self, who: str, what: str) -> int:
        label = self._at[what]
        self._walk(who, self._xy[label])
        event: dict[str, Any] = {"type": "label_vanished", "label": label}
        if label.startswith("cabinet"):
            event["weight_g"] = self._measured(what)
        self._events.append(event)
        self._at[what] = who
        return 1

    def _put(self, who: str, what: str) -> int:
        rnd = self._rnd
        kind = "cabinet" if rnd.random() < 0.6 else "floor"
        near = rnd.choice(CABINETS) if kind == "cabinet" else self._spot()
        spot = (near[0] + rnd.uniform(-0.3, 0.3), near[1] + rnd.uniform(-0.3, 0.3))
        self._walk(who, spot)
        label = self._label(kind, spot)
        event: dict[str, Any] = {"type": "label_appeared", "label": label, "kind": kind, "xy": list(spot)}
        if kind == "cabinet":
            event["weight_g"] = self._measured(what)
            if rnd.random() < 0.9:
                event["tag"] = f"T{what}" if rnd.random() < 0.8 else None
        elif rnd.random() < 0.5:
            size = next(o["size_m"] for o in self._objects if o["id"] == what)
            event["size_m"] = round(max(size + rnd.gauss(0, 0.02), 0.01), 3)
        self._events.append(event)
        self._at[what] = label
        return 1

    def _measured(self, what: str) -> float:
        weight: float = next(o["weight_g"] for o in self._objects if o["id"] == what)
        return round(max(weight + self._rnd.gauss(0, 18), 1.0), 1)

    def _walk(self, who: str, to: tuple[float, float]) -> None:
        """``who`` goes there, and often somebody else comes along."""
        rnd = self._rnd
        for person in self._people:
            if person == who or rnd.random() < 0.12:
                # Whoever acts is within the gate: beyond it the model holds him for impossible.
                angle, reach = rnd.uniform(0, 2 * math.pi), min(abs(rnd.gauss(0, 0.5)), 1.1)
                xy = (round(to[0] + reach * math.cos(angle), 3), round(to[1] + reach * math.sin(angle), 3))
                self._events.append({"type": "label_moved", "label": person, "xy": list(xy)})
        if rnd.random() < 0.02:
            a, b = rnd.sample(self._people, 2)
            self._events.append({"type": "handover_possible", "a": a, "b": b})

    def _label(self, kind: str, xy: tuple[float, float], *, start: bool = False) -> str:
        self._count += 1
        name = f"{kind}{self._count}"
        self._xy[name] = xy
        if start:
            self._labels.append({"id": name, "kind": kind, "xy": list(xy)})
        return name

    def _spot(self) -> tuple[float, float]:
        return (round(self._rnd.uniform(0.5, 5.5), 3), round(self._rnd.uniform(0.5, 4.5), 3))
