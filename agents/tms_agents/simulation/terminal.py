"""What the demo says on the terminal; plain text where it is piped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TextIO

from tms_agents.simulation import pies
from tms_agents.simulation.hardware import Plugs
from tms_agents.simulation.processes import command


def _devices(plug: Plugs) -> Iterator[str]:
    if plug.loads:
        yield f"load cells {plug.loads}"
    if plug.reader:
        yield f"TR3 {plug.reader}"
    if plug.states:
        yield f"joints and fingers tcp {plug.states[0]}:{plug.states[1]}"
    if plug.laser:
        yield f"laser tcp {plug.laser[0]}:{plug.laser[1]}"


class Terminal:
    def __init__(self, out: TextIO, *, colour: bool | None = None) -> None:
        """``colour`` None: only where ``out`` is a terminal."""
        self._out = out
        self._colour = out.isatty() if colour is None else colour

    def say(self, text: str) -> None:
        self._out.write(f"{text}\n")
        self._out.flush()

    def headline(self, url: str, room: str) -> None:
        self.say(f"The page: {self._bold(f'{url}/')}\nTen objects in room {room!r}; the experiment begins.")

    def devices(self, plugs: Mapping[str, Plugs], configs: Mapping[str, Path], without: Mapping[str, str]) -> None:
        """One line per agent: its emulated devices, where they are plugged in, and how it was started.

        ``without``: agents without a device, and why.
        """
        self.say("\nThe agents read emulated devices; name your own in such a file to use them instead:")
        for agent, plug in plugs.items():
            start = " ".join(["tms", *command(agent, configs[agent])])
            self.say(f"  {agent}: {', '.join(_devices(plug))}; {start}")
        for agent, why in without.items():
            self.say(f"  {agent}: {why}")
        self.say("Things are put into the cabinets, one by one; boards and readers take their time ...")

    def step(self, number: int, title: str) -> None:
        self.say(f"\n{self._bold(f'({number})')} {title}")

    def pies(self, found: Mapping[int, Mapping[str, float]], off: list[str]) -> None:
        self._out.write(pies.draw(found, colour=self._colour))
        for line in off:
            self.say(f"    NOT AS EXPECTED: {line}")
        self._out.flush()

    def verdict(self, wrong: int, *, weighed: bool) -> None:
        source = "as weighing tells" if weighed else "as in the paper"
        self.say(f"\nEvery pie is {source}, within 0.02." if wrong == 0 else f"\n{wrong} slices are not {source}.")

    def _bold(self, text: str) -> str:
        return f"\x1b[1m{text}\x1b[0m" if self._colour else text
