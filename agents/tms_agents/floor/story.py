"""What the floor's estimator tells, as a line for people."""

from __future__ import annotations

from tms_agents.floor import Appeared, Back, Confused, FloorEvent, Met, Stale, Vanished


def told(event: FloorEvent) -> str | None:
    """One line; None for what happens all the time."""
    if isinstance(event, Appeared):
        what = "robot" if event.robot else event.kind
        where = f"at ({event.xy[0]:.2f}, {event.xy[1]:.2f})"
        return f"{what} #{event.label} appeared {where}{_who(event.candidates, 'put by')}"
    if isinstance(event, Vanished):
        unsure = event.latest - event.earliest
        when = f", unseen for {unsure:.1f} s" if unsure > 1.0 else ""
        return f"#{event.label} is gone{_who(event.candidates, 'taken by')}{when}"
    if isinstance(event, Stale):
        return f"mover #{event.label} is out of sight"
    if isinstance(event, Back):
        return f"mover #{event.label} is back at ({event.xy[0]:.2f}, {event.xy[1]:.2f})"
    if isinstance(event, Confused) and event.since < event.t:
        return f"movers #{event.label} and #{event.other} may have been exchanged ({event.p:.0%})"
    if isinstance(event, Met):
        return f"one of movers #{event.label} and #{event.other} may have handed the other something"
    return None


def _who(candidates: tuple[tuple[int, float], ...], verb: str) -> str:
    likely = [f"#{label} ({p:.0%})" for label, p in sorted(candidates, key=lambda one: -one[1]) if p >= 0.05]
    return f", {verb} {' or '.join(likely)}" if likely else ""
