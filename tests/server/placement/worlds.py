"""Random scenarios that are valid and touch every rule of the event format, for comparison with the oracle."""

from random import Random
from typing import Any

KINDS = ("cabinet", "floor", "robot", "table")


class WorldMaker:
    """Draws objects, labels, a start and events; keeps track of what is active, so that events are valid."""

    def __init__(self, rnd: Random, *, events: int = 8) -> None:
        self.rnd = rnd
        self.count = 0
        self.kind: dict[str, str] = {}
        self.certain_empty: set[str] = set()
        n = rnd.randint(1, 5)
        self.tags = [f"T{i}" for i in range(n)]
        objects = [self.an_object(i) for i in range(n)]
        labels = [self.a_label() for _ in range(rnd.randint(0, 4))]
        params = self.parameters()
        initial, placed = self.start(objects, labels)
        self.maybe = placed
        self.scenario: dict[str, Any] = {
            "format": "placement-events/1",
            "name": "random",
            "params": params,
            "objects": objects,
            "labels": labels,
            "initial": initial,
            "events": [],
        }
        while len(self.scenario["events"]) < events:
            event = self.an_event()
            if event is not None:
                self.scenario["events"].append(event)

    def chance(self, p: float) -> bool:
        return self.rnd.random() < p

    def xy(self) -> list[float]:
        spread = 30.0 if self.chance(0.05) else 1.2
        return [round(self.rnd.uniform(-spread, spread), 3) for _ in range(2)]

    def an_object(self, i: int) -> dict[str, Any]:
        o: dict[str, Any] = {"id": i if self.chance(0.5) else f"obj{i}"}
        if self.chance(0.8):
            o["tag"] = self.tags[i]
        if self.chance(0.8):
            o["weight_g"] = self.rnd.choice([100, 104, 110, 120, 300])
        if self.chance(0.4):
            o["weight_sd_g"] = self.rnd.choice([2.0, 10.0])
        if self.chance(0.8):
            o["size_m"] = self.rnd.choice([0.05, 0.06, 0.1])
        if self.chance(0.3):
            o["p_read"] = self.rnd.choice([0.5, 0.8, 1.0])
        return o

    def name(self, kind: str) -> str:
        self.count += 1
        label = f"{kind[0]}{self.count}"
        self.kind[label] = kind
        return label

    def a_label(self) -> dict[str, Any]:
        kind = self.rnd.choice((*KINDS, "mover", "mover", "mover"))
        return {"id": self.name(kind), "kind": kind, "xy": self.xy()}

    def parameters(self) -> dict[str, Any]:
        r, p = self.rnd, {}
        options: dict[str, list[Any]] = {
            "mover_choice": ["holding"],
            "gate_m": [0.4, 1.0, 5.0],
            "sigma_m": [0.2, 1.0],
            "use_null_reads": [False],
            "p_read": [0.7, 1.0],
            "alpha": [{"cabinet": 1.0}, {"floor": 0.5}, dict.fromkeys((*KINDS, "mover", "handover"), 1.0)],
            "p_phantom": [{"floor": 0.1}, {"floor": 0.2, "cabinet": 0.05, "robot": 0.1, "table": 0.3}],
            "p_jump": [0.1, 0.3],
            "p_occlude": [{"floor": 0.3}, {"floor": 1.0}, dict.fromkeys(KINDS, 0.4)],
            "sigma_ghost_m": [0.5],
            "ghost_weight": [0.3, 3.0, 0.0],
            "use_weight": [False],
            "weight_sd_g": [2.0, 20.0],
            "use_size": [False],
            "p_return": [0.2, 0.5, 1.0],
            "use_handover": [False],
            "p_handover": [0.4, 1.0],
            "use_swap": [False],
        }  # fmt: skip
        for key, values in options.items():
            if self.chance(0.3):
                p[key] = r.choice(values)
        return p

    def start(self, objects: list[Any], labels: list[Any]) -> tuple[dict[str, Any], set[str]]:
        ids = [str(o["id"]) for o in objects]
        shelf = [x["id"] for x in labels if x["kind"] != "mover"]
        movers = [x["id"] for x in labels if x["kind"] == "mover"]
        kind = self.rnd.choice(["known", "list", "uniform", "known"])
        if kind == "uniform" and len(ids) >= len(shelf):
            return {"type": "uniform"}, set(shelf)

        def placement() -> dict[str, str]:
            free, out = list(shelf), {}
            for i in ids:
                spots = [*movers, "OUT", *free]
                spot = self.rnd.choice(spots)
                if spot in free:
                    free.remove(spot)
                if spot != "OUT" or self.chance(0.5):
                    out[i] = spot
            return out

        if kind == "list":
            hypotheses = [
                {"p": round(self.rnd.uniform(0.1, 2), 2), "placement": placement()}
                for _ in range(self.rnd.randint(1, 4))
            ]
            return {"type": "list", "hypotheses": hypotheses}, set(shelf)
        return {"type": "known", "placement": placement()}, set(shelf)

    def active(self, *kinds: str) -> list[str]:
        return [x for x, k in self.kind.items() if k in kinds]

    def a_tag(self) -> str:
        return "UNKNOWN" if self.chance(0.05) else self.rnd.choice(self.tags)

    def an_event(self) -> dict[str, Any] | None:
        r = self.rnd
        movers, shelf = self.active("mover"), self.active(*KINDS)
        types = {
            "label_appeared": 5, "label_vanished": 4, "label_moved": 1, "mover_entered": 1, "mover_left": 1,
            "tag_observed": 2, "tag_missed": 2, "handover": 1, "handover_possible": 1, "mover_swap": 1,
            "transfer": 1, "load_change": 1, "tick": 0.3,
        }  # fmt: skip
        kind = r.choices(list(types), list(types.values()))[0]
        e: dict[str, Any] = {"type": kind}
        if kind == "tick":
            return {**e, "n": 3}
        if kind == "label_appeared":
            what = r.choice(KINDS)
            e.update(kind=what, xy=self.xy())
            if self.chance(0.5):
                e["tag"] = None if self.chance(0.3) else self.a_tag()
            if self.chance(0.3):
                e["weight_g"] = r.choice([100, 106, 118, 295])
            if self.chance(0.3):
                e["size_m"] = r.choice([0.05, 0.07, 0.1])
            if self.chance(0.15) and movers:
                e["source"] = r.choice(movers)
            e["label"] = self.name(what)
            return e
        if kind == "mover_entered":
            return {**e, "xy": self.xy(), "label": self.name("mover")}
        if kind == "tag_observed" or kind == "tag_missed":
            if not self.kind:
                return None
            if self.chance(0.5):
                zone = r.sample(list(self.kind), r.randint(1, len(self.kind)))
                return {**e, "labels": zone, "tag": self.a_tag()}
            label = r.choice(list(self.kind))
            if kind == "tag_observed" or self.kind[label] == "mover":
                e["tag"] = self.a_tag()
            return {**e, "label": label}
        if kind == "label_moved":
            return {**e, "label": r.choice(list(self.kind)), "xy": self.xy()} if self.kind else None
        if kind == "load_change":
            if not shelf:
                return None
            some = r.sample(shelf, r.randint(1, min(2, len(shelf))))
            return {**e, "labels": some, "weight_g": r.choice([-1, 1]) * r.choice([100, 210, 404])}
        if kind == "label_vanished":
            if not shelf:
                return None
            e["label"] = r.choice(shelf)
            if self.chance(0.3):
                e["weight_g"] = r.choice([100, 106, 118, 295])
            if self.chance(0.15) and movers:
                e["dest"] = r.choice(movers)
            del self.kind[e["label"]]
            return e
        if not movers:
            return None
        if kind == "mover_left":
            label = r.choice(movers)
            del self.kind[label]
            return {**e, "label": label}
        if kind == "transfer":
            source = r.choice(list(self.kind))
            if self.kind[source] == "mover":
                others = [m for m in movers if m != source]
                to = self.name("mover") if not others or self.chance(0.5) else r.choice(others)
            elif self.chance(0.2):
                to = r.choice(movers)
            else:
                what = r.choice(KINDS)
                to = self.name(what)
                e["kind"] = what
                if self.chance(0.5):
                    e["xy"] = self.xy()
            del self.kind[source]
            return {**e, "from": source, "to": to}
        if len(movers) < 2:
            return None
        a, b = r.sample(movers, 2)
        if kind == "handover":
            e.update({"from": a, "to": b})
            if self.chance(0.5):
                e["tag"] = None if self.chance(0.2) else self.a_tag()
            return e
        e.update(a=a, b=b)
        if kind == "mover_swap" or self.chance(0.5):
            e["p"] = r.choice([0.3, 0.05, 1.0])
        return e
