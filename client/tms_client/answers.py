"""Answers with the small conveniences robot code and people want."""

from __future__ import annotations

from collections.abc import Mapping

from tms_schemas.belief import OUTSIDE, LocationAnswer, PlaceProbability


class Location(LocationAnswer):
    """Where an object probably is. ``best`` is the most probable place that has a position."""

    @property
    def places(self) -> list[PlaceProbability]:
        """The slices of the pie, most probable first (ties by label, so that the order is stable)."""
        return sorted(self.distribution, key=lambda place: (-place.p, place.label))

    @property
    def top(self) -> PlaceProbability | None:
        """The most probable slice, also where it has no position (outside)."""
        return self.places[0] if self.distribution else None

    def p(self, *labels: str) -> float:
        """Probability that it is at one of ``labels``."""
        return sum(place.p for place in self.distribution if place.label in labels)

    def certain(self, p: float = 0.95) -> bool:
        """True where one place holds at least ``p``."""
        return self.top is not None and self.top.p >= p

    def in_words(self) -> str:
        """The distribution in plain words, one line per place of at least 0.1 %."""
        names = {share.id: share.name for share in [*self.furniture, *self.holders] if share.name}
        head = f"{self.name} ({self.tag})" + (f" in {self.room}" if self.room else "")
        if not self.distribution:
            return f"{head}: nothing is known\n"
        lines = [f"{head}:"]
        lines += [f"  {place.p:6.1%}  {_place(place, names)}" for place in self.places if place.p >= 0.0005]
        if self.last_direct_evidence is None:
            lines.append("  its tag was not read yet")
        elif self.staleness_s is not None:
            lines.append(f"  its tag was last read {_ago(self.staleness_s)} by {self.last_direct_evidence.agent}")
        if self.contradiction:
            lines.append("  the newest evidence contradicts what was known; the room should be looked at")
        return "\n".join(lines) + "\n"


def _place(place: PlaceProbability, names: Mapping[str, str]) -> str:
    if place.label == OUTSIDE:
        return "outside the room"
    words = {
        "cabinet": "in the cabinet",
        "floor": "on the floor",
        "robot": "in a robot's hand",
        "table": "put down by a robot",
        "mover": "carried by",
        "outside": "outside the room",
    }[place.kind]
    if place.kind == "mover":
        words += f" {names.get(place.label) or place.label}"
    elif place.surface or place.furniture:
        spot = place.surface or place.furniture or ""
        name = names.get(place.furniture or "")
        words += f", {name} ({spot})" if name else f", {spot}"
    if place.xy is not None:
        words += f" at x {place.xy[0]:.2f} m, y {place.xy[1]:.2f} m"
    notes = [note for note, true in (("hidden", place.ghost), ("sensor silent", place.stale)) if true]
    return words + (f" ({', '.join(notes)})" if notes else "") + f" [{place.label}]"


def _ago(seconds: float) -> str:
    for unit, size in (("day", 86400), ("hour", 3600), ("minute", 60)):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}s before"
    return f"{seconds:.0f} s before"
