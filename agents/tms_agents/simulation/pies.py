"""Pies in plain text: where the moved objects probably are, read from the server's answer, as bars and percentages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from tms_agents.simulation.catalogue import ITEMS
from tms_agents.simulation.story import TOLERANCE, Pies
from tms_schemas.belief import PlacementsAnswer, PlaceProbability

BAR = 30
#: Fill of the bar and ANSI colour of each kind of place.
_LOOKS = {
    "cabinet": ("#", "34"),
    "floor": ("=", "33"),
    "robot's hand": ("+", "35"),
    "table": ("*", "36"),
    "person": (".", "37"),
    "robot": ("~", "37"),
    "outside": ("?", "90"),
}


def pies_of(answer: PlacementsAnswer, numbers: Iterable[int]) -> dict[int, dict[str, float]]:
    """Probability per place in words, for each of the objects; slices at one place are added up."""
    by_tag = {one.tag: one for one in answer.objects}
    pies: dict[int, dict[str, float]] = {}
    for number in numbers:
        pie = pies[number] = dict[str, float]()
        placement = by_tag.get(ITEMS[number].tag)
        for place in placement.distribution if placement else ():
            words = place_of(place)
            pie[words] = pie.get(words, 0.0) + place.p
    return pies


def place_of(place: PlaceProbability) -> str:
    """``cabinet A``, ``floor``, ``robot's hand``, ``table``, ``person``, ``robot`` or ``outside``."""
    agent = place.label.partition("/")[0]
    match place.kind:
        case "cabinet":
            return f"cabinet {agent.rpartition('-')[2].upper()}"
        case "robot":
            return "robot's hand"
        case "mover":
            return "robot" if agent == "robot" else "person"
        case "outside" | "floor" | "table":
            return place.kind


def differences(expected: Pies, found: Mapping[int, Mapping[str, float]]) -> list[str]:
    """One line for every slice that is off by more than ``TOLERANCE``, also for slices nobody expects."""
    lines = []
    for number, pie in expected.items():
        for place in sorted({*pie, *found.get(number, {})}):
            want, got = pie.get(place, 0.0), found.get(number, {}).get(place, 0.0)
            if abs(want - got) > TOLERANCE:
                lines.append(f"object {number}: {place} should be {want:.3f} and is {got:.3f}")
    return lines


def draw(pies: Mapping[int, Mapping[str, float]], *, colour: bool) -> str:
    """One line per object; ``colour`` uses ANSI colours and blocks, else plain ASCII."""
    lines = []
    for number, pie in pies.items():
        slices = [(place, p) for place, p in sorted(pie.items(), key=lambda item: (-item[1], item[0])) if p >= 0.005]
        words = ", ".join(f"{place} {100 * p:.0f} %" for place, p in slices)
        lines.append(f"    {number} {ITEMS[number].name:<13} |{_bar(slices, colour=colour)}| {words}\n")
    return "".join(lines)


def _bar(slices: list[tuple[str, float]], *, colour: bool) -> str:
    cells, done, total = "", 0, 0.0
    for place, p in slices:
        total += p
        width = min(BAR, round(total * BAR)) - done
        done += width
        fill, code = _LOOKS["cabinet" if place.startswith("cabinet") else place]
        cells += f"\x1b[{code}m{'█' * width}\x1b[0m" if colour else fill * width
    return cells + " " * (BAR - done)
