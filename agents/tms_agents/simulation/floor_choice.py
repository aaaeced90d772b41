"""Which floor sensor the demo has: an emulated laser and its agent wherever they can follow, or one without device."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

from tms_client.cli import CommandError

#: The laser and its agent keep real time: people must walk as people do.
SLOWEST, FASTEST = 0.5, 1.25


def why_no_laser(wish: bool | None, speed: float, find: Callable[[str], object] = find_spec) -> str | None:
    """In words; None: a laser sees the floor. ``wish`` None: if it can.

    Raises:
        CommandError: the laser was asked for and cannot be.
    """
    if wish is False:
        return "a floor sensor without device, as asked for"
    missing = next((name for name in ("numba", "scipy") if find(name) is None), None)
    if missing is not None:
        reason = f'the laser needs {missing}: pip install "robot-town-tms[slam]"'
    elif not SLOWEST <= speed <= FASTEST:
        reason = f"the laser needs people who walk as people do, --speed {SLOWEST:g} to {FASTEST:g}, not {speed:g}"
    else:
        return None
    if wish:
        raise CommandError(reason)
    return f"a floor sensor without device; {reason}"


def say_if_it_compiles(say: Callable[[str], None]) -> None:
    """The laser's agent takes its time at the first start."""
    from tms_agents.floor.warm import compiled_before  # needs numba and scipy, as the laser does

    if not compiled_before():
        say("compiling the floor's estimator, which happens at the first start only (a minute or two) ...")
