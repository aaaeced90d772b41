"""A brute-force oracle for ``placement-events/1``: a plain dict {placement tuple: probability}, nothing clever.

Written from the text of the event format, sharing no code with the engine. Events and scenarios are plain JSON dicts.
"""

import math
from collections import defaultdict

EMPTY = None
DEFAULTS = {
    "sigma_m": 0.5, "gate_m": None, "mover_choice": "all",
    "alpha": {"cabinet": 0.98, "robot": 0.99, "table": 0.99, "floor": 0.9, "mover": 0.95, "handover": 0.99},
    "p_read": 0.95, "use_null_reads": True,
    "p_phantom": {}, "p_jump": 0.0, "p_occlude": {},
    "sigma_ghost_m": 0.15, "ghost_weight": 1.0,
    "use_weight": True, "weight_sd_g": 5.0, "weight_range_g": 3000.0,
    "use_size": True, "size_sd_m": 0.02, "size_range_m": 0.5,
    "p_return": 0.0, "use_handover": True, "p_handover": 0.1, "use_swap": True,
    "prune_eps": 0.0, "p_correction": 0.999,
}  # fmt: skip


def gauss(x, mean, var):
    return math.exp(-((x - mean) ** 2) / (2 * var)) / math.sqrt(2 * math.pi * var)


class Oracle:
    def __init__(self, scenario):
        self.p = {k: dict(v) if isinstance(v, dict) else v for k, v in DEFAULTS.items()}
        for k, v in scenario["params"].items():
            self.p[k] = {**self.p[k], **v} if isinstance(v, dict) else v
        self.objects = scenario["objects"]
        self.n = len(self.objects)
        self.kind = {x["id"]: x["kind"] for x in scenario["labels"]}
        self.xy = {x["id"]: x["xy"] for x in scenario["labels"]}
        self.ghosts = {}
        self.tags = {o["tag"]: i for i, o in enumerate(self.objects) if o.get("tag") is not None}
        self.nt = max(len(self.tags), 1)
        self.belief = self.normalised(self.start(scenario["initial"]))
        self.bound = 0.0

    # -- start

    def start(self, initial):
        ids = [str(o["id"]) for o in self.objects]
        out = defaultdict(float)
        if initial["type"] == "known":
            out[tuple(initial["placement"].get(i, "OUT") for i in ids)] = 1.0
        elif initial["type"] == "list":
            for h in initial["hypotheses"]:
                out[tuple(h["placement"].get(i, "OUT") for i in ids)] += h["p"]
        else:
            shelf = [x for x in self.kind if self.kind[x] != "mover"]
            spots = shelf + ([x for x in self.kind if self.kind[x] == "mover"] or ["OUT"])

            def fill(done):
                if len(done) == self.n:
                    if all(done.count(s) == 1 for s in shelf):
                        out[tuple(done)] = 1.0
                    return
                for s in spots:
                    if s in shelf and s in done:
                        continue
                    fill([*done, s])

            fill([])
        return out

    @staticmethod
    def normalised(belief):
        total = sum(belief.values())
        return {x: w / total for x, w in belief.items() if w > 0}

    # -- likelihoods

    def p_read(self, i):
        if not self.p["use_null_reads"]:
            return 1.0
        own = self.objects[i].get("p_read")
        return self.p["p_read"] if own is None else own

    def tagged(self, i):
        return self.objects[i].get("tag") is not None

    def tag_factor(self, c, tag, alpha):
        """tag: a name, or None for "nothing"."""
        if tag is None:
            if not self.p["use_null_reads"]:
                return 1.0
            if c is EMPTY:
                return alpha
            return 1 - self.p_read(c) if self.tagged(c) else 1.0
        if tag not in self.tags:
            return 1.0
        k = self.tags[tag]
        if c is EMPTY:
            return (1 - alpha) / self.nt
        if not self.tagged(c):
            return 0.0
        if c == k:
            return self.p_read(k) * alpha
        return self.p_read(c) * (1 - alpha) / max(self.nt - 1, 1)

    def weight_factor(self, c, event):
        w = event.get("weight_g")
        if w is None or not self.p["use_weight"]:
            return 1.0
        if c is EMPTY or self.objects[c].get("weight_g") is None:
            return 1 / self.p["weight_range_g"]
        o = self.objects[c]
        return gauss(w, o["weight_g"], self.p["weight_sd_g"] ** 2 + o.get("weight_sd_g", 0.0) ** 2)

    def size_factor(self, c, event):
        s = event.get("size_m")
        if s is None or not self.p["use_size"]:
            return 1.0
        if c is EMPTY or self.objects[c].get("size_m") is None:
            return 1 / self.p["size_range_m"]
        return gauss(s, self.objects[c]["size_m"], self.p["size_sd_m"] ** 2)

    def log_k(self, mover, xy):
        return -(math.dist(self.xy[mover], xy) ** 2) / (2 * self.p["sigma_m"] ** 2)

    def gated(self, movers, xy):
        """The movers that count: those inside the gate, or all if nobody is."""
        if self.p["gate_m"] is None:
            return list(movers)
        inside = [m for m in movers if math.dist(self.xy[m], xy) <= self.p["gate_m"]]
        return inside or list(movers)

    @staticmethod
    def normalised_logs(logs):
        if not logs:
            return {}
        top = max(logs.values())
        raw = {k: math.exp(v - top) for k, v in logs.items()}
        return {k: v / sum(raw.values()) for k, v in raw.items()}

    # -- events

    def apply(self, event):
        """(log evidence, contradiction)"""
        out, undo = getattr(self, "on_" + event["type"])(event)
        if out is None:
            return 0.0, False
        total = sum(out.values())
        contradiction = not total > 0
        if contradiction:
            self.belief = self.normalised(undo)
        else:
            self.belief = {x: w / total for x, w in out.items() if w / total > 0}
            self.bound *= self.sup / total
        self.prune()
        return (0.0 if contradiction else math.log(total)), contradiction

    def prune(self):
        eps, dropped = self.p["prune_eps"], 0.0
        if eps <= 0:
            return
        for x in sorted(self.belief, key=self.belief.get):
            if dropped + self.belief[x] > eps:
                break
            dropped += self.belief.pop(x)
        self.belief = self.normalised(self.belief)
        self.bound = (self.bound + dropped) / (1 - dropped)

    def movers(self):
        return [x for x, k in self.kind.items() if k == "mover"]

    def held(self, x, label):
        return [i for i in range(self.n) if x[i] == label]

    @staticmethod
    def put(x, i, label):
        return (*x[:i], label, *x[i + 1 :])

    def on_label_appeared(self, e):
        p, label, xy = self.p, e["label"], e["xy"]
        alpha = p["alpha"][e["kind"]]

        def factor(c):
            f = self.weight_factor(c, e) * self.size_factor(c, e)
            return f * self.tag_factor(c, e["tag"], alpha) if "tag" in e else f

        self.sup = max(factor(c) for c in [EMPTY, *range(self.n)])
        phantom = p["p_phantom"].get(e["kind"], 0.0)
        u = 1 - phantom - p["p_jump"]
        shelf = [x for x, k in self.kind.items() if k != "mover"]
        if e.get("source") is not None:
            movers, ghosts = [e["source"]], {}
        else:
            movers, ghosts = self.movers(), self.ghosts
        ghost_logs = {
            g: math.log(p["ghost_weight"]) - math.dist(gxy, xy) ** 2 / (2 * p["sigma_ghost_m"] ** 2)
            for g, gxy in ghosts.items()
            if p["ghost_weight"] > 0
        }
        out = defaultdict(float)
        for x, w in self.belief.items():
            can_move, can_ghost = movers, ghost_logs
            if p["mover_choice"] == "holding":
                can_move = [m for m in movers if self.held(x, m)]
                can_ghost = {g: v for g, v in ghost_logs.items() if self.held(x, g)}
            chance = self.normalised_logs({m: self.log_k(m, xy) for m in self.gated(can_move, xy)} | can_ghost)
            if not chance:
                out[x] += w * u * factor(EMPTY)
            for m, pm in chance.items():
                things = self.held(x, m)
                for i in things:
                    out[self.put(x, i, label)] += w * u * pm / len(things) * factor(i)
            out[x] += w * phantom * factor(EMPTY)
            loose = [i for i in range(self.n) if x[i] == "OUT" or x[i] in shelf]
            for i in loose:
                out[self.put(x, i, label)] += w * p["p_jump"] / len(loose) * factor(i)
            if not loose:
                out[x] += w * p["p_jump"] * factor(EMPTY)
        self.kind[label], self.xy[label] = e["kind"], xy
        return out, dict(self.belief)

    def on_label_vanished(self, e):
        label = e["label"]
        hide = self.p["p_occlude"].get(self.kind[label], 0.0)
        if e.get("dest") is not None:
            chance, hide = {e["dest"]: 1.0}, 0.0
        else:
            chance = self.normalised_logs(
                {m: self.log_k(m, self.xy[label]) for m in self.gated(self.movers(), self.xy[label])}
            ) or {"OUT": 1.0}
        self.sup = max(self.weight_factor(c, e) for c in [EMPTY, *range(self.n)])
        out, plain = defaultdict(float), defaultdict(float)
        for x, w in self.belief.items():
            inside = self.held(x, label)
            if not inside:
                out[x] += w * self.weight_factor(EMPTY, e)
                plain[x] += w
                continue
            i = inside[0]
            f = self.weight_factor(i, e)
            out[x] += w * hide * f
            plain[x] += w * hide
            for m, pm in chance.items():
                out[self.put(x, i, m)] += w * (1 - hide) * pm * f
                plain[self.put(x, i, m)] += w * (1 - hide) * pm
        if hide > 0:
            self.ghosts[label] = self.xy[label]
        del self.kind[label]
        return out, plain

    def on_label_moved(self, e):
        self.xy[e["label"]] = e["xy"]
        return None, None

    def on_tick(self, e):
        return None, None

    def on_mover_entered(self, e):
        self.kind[e["label"]], self.xy[e["label"]] = "mover", e["xy"]
        self.sup = 1.0
        r = self.p["p_return"]
        belief = self.belief
        for i in range(self.n):
            out = defaultdict(float)
            for x, w in belief.items():
                if x[i] == "OUT":
                    out[self.put(x, i, e["label"])] += w * r
                    out[x] += w * (1 - r)
                else:
                    out[x] += w
            belief = out
        return belief, None

    def relabelled(self, a, b):
        out = defaultdict(float)
        for x, w in self.belief.items():
            out[tuple(b if s == a else s for s in x)] += w
        self.sup = 1.0
        return out

    def on_mover_left(self, e):
        del self.kind[e["label"]]
        return self.relabelled(e["label"], "OUT"), None

    def on_transfer(self, e):
        a, b = e["from"], e["to"]
        if b not in self.kind:
            self.kind[b] = e.get("kind") or self.kind[a]
            self.xy[b] = e.get("xy") or self.xy[a]
        del self.kind[a]
        return self.relabelled(a, b), None

    def multiplied(self, factor):
        return {x: w * factor(x) for x, w in self.belief.items()}, dict(self.belief)

    def zone(self, labels, tag, seen):
        k = self.tags[tag]
        alpha = self.p["alpha"][self.kind[labels[0]]]
        inside, outside = self.p_read(k) * alpha, (1 - alpha) / self.nt
        if not seen:
            inside, outside = 1 - inside, 1 - outside
        self.sup = max(inside, outside)
        return self.multiplied(lambda x: inside if x[k] in labels else outside)

    def content(self, x, label):
        inside = self.held(x, label)
        return inside[0] if inside else EMPTY

    def single(self, label, tag):
        alpha = self.p["alpha"][self.kind[label]]
        self.sup = max(self.tag_factor(c, tag, alpha) for c in [EMPTY, *range(self.n)])
        return self.multiplied(lambda x: self.tag_factor(self.content(x, label), tag, alpha))

    def on_tag_observed(self, e):
        if e["tag"] not in self.tags:
            return None, None
        labels = e.get("labels") or [e["label"]]
        if "labels" in e or self.kind[e["label"]] == "mover":
            return self.zone(labels, e["tag"], True)
        return self.single(e["label"], e["tag"])

    def on_tag_missed(self, e):
        if not self.p["use_null_reads"]:
            return None, None
        if "labels" in e or self.kind[e["label"]] == "mover":
            if e.get("tag") not in self.tags:
                return None, None
            return self.zone(e.get("labels") or [e["label"]], e["tag"], False)
        return self.single(e["label"], None)

    def on_handover(self, e):
        tag, alpha = e.get("tag"), self.p["alpha"]["handover"]

        def factor(i):
            return 1.0 if tag is None else self.tag_factor(i, tag, alpha)

        out = defaultdict(float)
        self.sup = max(1.0 if tag is None else self.tag_factor(c, tag, alpha) for c in [EMPTY, *range(self.n)])
        for x, w in self.belief.items():
            things = self.held(x, e["from"])
            for i in things:
                out[self.put(x, i, e["to"])] += w / len(things) * factor(i)
        return out, dict(self.belief)

    def on_handover_possible(self, e):
        if not self.p["use_handover"]:
            return None, None
        p = self.p["p_handover"] if e.get("p") is None else e["p"]
        self.sup = 1.0
        out = defaultdict(float)
        for x, w in self.belief.items():
            out[x] += w * (1 - p)
            for giver, taker in ((e["a"], e["b"]), (e["b"], e["a"])):
                things = self.held(x, giver)
                for i in things:
                    out[self.put(x, i, taker)] += w * p / 2 / len(things)
                if not things:
                    out[x] += w * p / 2
        return out, None

    def on_mover_swap(self, e):
        if not self.p["use_swap"]:
            return None, None
        self.sup = 1.0
        other = {e["a"]: e["b"], e["b"]: e["a"]}
        out = defaultdict(float)
        for x, w in self.belief.items():
            out[x] += w * (1 - e["p"])
            out[tuple(other.get(s, s) for s in x)] += w * e["p"]
        return out, None

    def on_load_change(self, e):
        if not self.p["use_weight"]:
            return None, None

        def factor(x):
            contents = [self.content(x, label) for label in e["labels"]]
            if any(c is EMPTY or self.objects[c].get("weight_g") is None for c in contents):
                return 1 / self.p["weight_range_g"]
            things = [self.objects[c] for c in contents]
            variance = self.p["weight_sd_g"] ** 2 + sum(o.get("weight_sd_g", 0.0) ** 2 for o in things)
            return gauss(abs(e["weight_g"]), sum(o["weight_g"] for o in things), variance)

        self.sup = max(1 / self.p["weight_range_g"], 1 / math.sqrt(2 * math.pi) / self.p["weight_sd_g"])
        return self.multiplied(factor)

    # -- answers

    def marginals(self):
        out = {str(o["id"]): defaultdict(float) for o in self.objects}
        for x, w in self.belief.items():
            for o, place in zip(self.objects, x, strict=True):
                out[str(o["id"])][place] += w
        return out
