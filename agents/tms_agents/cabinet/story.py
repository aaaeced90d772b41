"""An event in one line for people."""

from __future__ import annotations

from tms_agents.cabinet import Appeared, CabinetEvent, Identified, LoadChanged, Moved, Vanished, Weighed


def told(board: str, event: CabinetEvent) -> str:
    if isinstance(event, Appeared):
        what = f"put    #{event.stay} {event.weight_g:.0f} g at {_at(event.xy)}"
    elif isinstance(event, Vanished):
        what = f"taken  #{event.stay} {abs(event.weight_g):.0f} g"
    elif isinstance(event, Weighed):
        what = f"weight #{event.stay} is {event.weight_g:.0f} g"
    elif isinstance(event, Moved):
        what = f"moved  #{event.stay} to {_at(event.xy)}"
    elif isinstance(event, Identified):
        what = f"tag    #{event.stay} is {event.tag}"
    elif isinstance(event, LoadChanged):
        what = f"load   {event.weight_g:+.0f} g over {', '.join(f'#{one}' for one in event.stays)}"
    else:
        what = f"zone   {event.zone} reads {event.tag or 'nothing'}"
    return f"{board}: {what}"


def _at(xy: tuple[float, float]) -> str:
    return f"({xy[0]:.2f}, {xy[1]:.2f})"
