"""What the emulated reader does with a ROSpec: which antennas read when, what is reported when."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from tms_agents.devices.llrp.codec import Parameter
from tms_agents.devices.tags import TagRead

_IMMEDIATE, _PERIODIC, _DURATION = 1, 2, 1


@dataclass(frozen=True, slots=True)
class Turn:
    """An AISpec: ``duration_s`` None reads for ever."""

    antennas: tuple[int, ...]
    duration_s: float | None


@dataclass(frozen=True, slots=True)
class RoSpec:
    id: int
    #: Starts when enabled; with ``period_s`` again and again.
    starts_itself: bool
    period_s: float | None
    turns: tuple[Turn, ...]

    @classmethod
    def of(cls, rospec: Parameter) -> RoSpec:
        boundary = rospec.find("ROBoundarySpec")
        trigger = boundary.find("ROSpecStartTrigger") if boundary else None
        kind = trigger.number("ROSpecStartTriggerType") if trigger else 0
        period = trigger.find("PeriodicTriggerValue") if trigger and kind == _PERIODIC else None
        return cls(
            rospec.number("ROSpecID"),
            kind in (_IMMEDIATE, _PERIODIC),
            period.number("Period") / 1000 if period else None,
            tuple(map(_turn, rospec.all("AISpec"))),
        )


def _turn(aispec: Parameter) -> Turn:
    antennas = aispec.values["AntennaIDs"]
    assert isinstance(antennas, tuple)
    stop = aispec.find("AISpecStopTrigger")
    timed = stop is not None and stop.number("AISpecStopTriggerType") == _DURATION
    numbers = tuple(one for one in antennas if isinstance(one, int))
    return Turn(numbers, stop.number("DurationTrigger") / 1000 if stop and timed else None)


async def run(
    rospec: RoSpec,
    *,
    look: Callable[[tuple[int, ...]], Iterable[TagRead]],
    report: Callable[[list[TagRead]], None],
    ended: Callable[[int], None],
    step_s: float,
) -> None:
    """Read until cancelled or done: ``look`` at the antennas every ``step_s``.

    A turn with a duration reports once when it is over, then ``ended`` is told its number; one without reports at each
    look.
    """
    clock = asyncio.get_running_loop().time
    while True:
        begin = clock()
        for number, turn in enumerate(rospec.turns, 1):
            if turn.duration_s is None:
                while True:
                    await asyncio.sleep(step_s)
                    report(list(look(turn.antennas)))
            seen: dict[tuple[str, int], TagRead] = {}
            over = clock() + turn.duration_s
            while (left := over - clock()) > 0:
                seen |= {(read.tag, read.antenna): read for read in look(turn.antennas)}
                await asyncio.sleep(min(step_s, left))
            report(list(seen.values()))
            ended(number)
        if rospec.period_s is None:
            return
        await asyncio.sleep(max(0.0, begin + rospec.period_s - clock()))
