"""Fetch and carry: a robot asks where the tea bottle is, looks at the best place first, then at the next one.

Start a town in one terminal, and this in another one while the story goes on::

    tms demo
    python examples/fetch_and_carry.py --url http://127.0.0.1:PORT "tea bottle"

The program is the whole of what a robot needs of the Town Management System: ``Town.where`` gives a distribution over
places; driving and looking are the robot's own and stand here as ``Robot``, simulated: what it finds is drawn from the
distribution itself (``--seed``), or said by ``--really-at`` with a part of the place's name.
"""

from __future__ import annotations

import argparse
import math
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from tms_client import Location, Town, TownError
from tms_schemas.belief import PlaceProbability

#: Looking anywhere that is less likely is a waste of the battery.
WORTH_A_LOOK = 0.02
SPEED_M_S = 0.5
#: From this far a hand camera can read what is there.
STAND_OFF_M = 0.6


@dataclass
class Robot:
    """Drives in straight lines and looks: the part to replace by a real one."""

    xy: tuple[float, float]
    sees: Callable[[PlaceProbability], bool]
    seconds: float = 0.0

    def drive_to(self, target: tuple[float, float]) -> None:
        gap = max(0.0, math.dist(self.xy, target) - STAND_OFF_M)
        self.seconds += gap / SPEED_M_S
        if gap > 0:
            share = gap / math.dist(self.xy, target)
            self.xy = (
                self.xy[0] + share * (target[0] - self.xy[0]),
                self.xy[1] + share * (target[1] - self.xy[1]),
            )


def plan(answer: Location) -> list[PlaceProbability]:
    """Places to look at, the most probable first; what is outside the room cannot be driven to."""
    return [place for place in answer.places if place.xy is not None and place.p >= WORTH_A_LOOK]


def fetch(town: Town, robot: Robot, name: str) -> Iterator[str]:
    """Look for the thing; yields what happens, in words. The last line says whether it was found."""
    answer = town.where(name)
    places = plan(answer)
    yield f"{answer.name} ({answer.tag}) in {answer.room}: {len(places)} place(s) worth a look"
    for number, place in enumerate(places, 1):
        yield f"  {number}. {describe(place)}, {place.p:.0%}"
    for place in places:
        assert place.xy is not None
        robot.drive_to(place.xy)
        there = f"{robot.seconds:.1f} s: at ({robot.xy[0]:.2f}, {robot.xy[1]:.2f}), looking {describe(place)}"
        if not robot.sees(place):
            yield f"{there}: not there"
            continue
        if place.kind == "mover":
            yield f"{there}: found; asking for it to be handed over"
        else:
            yield f"{there}: found; grasping it"
        return
    yield "not found; asking a person"


def describe(place: PlaceProbability) -> str:
    """The place in words, with the label's name for the log."""
    words = {
        "cabinet": f"in {place.furniture or 'a cabinet'}",
        "floor": "on the floor",
        "robot": "in a robot's hand",
        "table": f"on {place.furniture or 'furniture'}",
        "mover": "with the person",
        "outside": "outside",
    }
    return f"{words[place.kind]} [{place.label}]"


def simulated_eyes(answer: Location, seed: int, really_at: str | None) -> Callable[[PlaceProbability], bool]:
    """Where the thing is in this simulation: said, or drawn from the distribution."""
    if really_at is not None:
        return lambda place: really_at in describe(place)
    places = answer.places
    (truth,) = random.Random(seed).choices(places, weights=[place.p for place in places])
    return lambda place: place.label == truth.label


def main() -> int:
    parser = argparse.ArgumentParser(description="Fetch a thing: ask the town, go to the best place, try the next.")
    parser.add_argument("name", nargs="?", default="tea bottle", help="tag, name or synonym (default: tea bottle)")
    parser.add_argument("--url", default="http://127.0.0.1:8080", help="address of the server")
    parser.add_argument("--key", help="API key with the scope read:<room>")
    parser.add_argument("--seed", type=int, default=0, help="of the simulated truth")
    parser.add_argument("--really-at", metavar="WORDS", help="the simulated truth: a part of a place's description")
    arguments = parser.parse_args()
    try:
        with Town(arguments.url, arguments.key) as town:
            eyes = simulated_eyes(town.where(arguments.name), arguments.seed, arguments.really_at)
            for line in fetch(town, Robot(xy=(2.9, 0.5), sees=eyes), arguments.name):
                print(line)
    except TownError as error:
        print(f"fetch_and_carry: {error}")
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
