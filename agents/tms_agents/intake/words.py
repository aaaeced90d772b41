"""What ``tms intake`` says, for a carer: one line each."""

from __future__ import annotations

from tms_agents.intake.codes import sgtin_96
from tms_client.errors import Conflict, Forbidden, Invalid, TownError, Unauthenticated, Unreachable
from tms_schemas.objects import IntakeResult, TownObject

NOT_IN_CATALOGUE = "not in the catalogue yet"


def thing(known: TownObject) -> str:
    """Name, weight, tag and room."""
    weight = None if known.weight_g is None else f"{known.weight_g:g} g"
    room = "no room yet" if known.room is None else f"room {known.room}"
    return ", ".join(part for part in (known.name, weight, f"tag {known.tag}", room) if part)


def registered(result: IntakeResult) -> str:
    if result.created:
        return f"Registered: {thing(result.object)}."
    return f"Registered already, nothing to do: {thing(result.object)}."


def already(known: TownObject) -> str:
    return f"This is registered: {thing(known)}."


def scanned(code: str, product: str, instead_of: str | None) -> str:
    """``product`` is its name, or what is known of it; "" where that could not be asked."""
    what = f"{code} ({product})" if product else code
    dropped = f" The scan of {instead_of} before it is forgotten." if instead_of else ""
    return f"Scanned {what}.{dropped} Now hold the thing at the reader."


def alone(tag: str) -> str:
    inside = sgtin_96(tag)
    own = f" (its own number {inside} is not known here)" if inside else ""
    return f"Tag {tag}{own}. Now scan the barcode of this thing."


def several(tags: tuple[str, ...]) -> str:
    listed = ", ".join(tags[:6]) + (" ..." if len(tags) > 6 else "")
    return f"{len(tags)} tags at the reader: {listed}. Take all away, then hold one thing alone."


def expired(code: str | None, tag: str | None) -> str:
    what = f"The scan of {code}" if code is not None else f"Tag {tag}"
    return f"{what} has waited too long and is forgotten. Start with that thing again."


def ask_name(code: str) -> str:
    return f"{code} is not in the catalogue. What is it? Type its name (only Enter: leave it out)."


def unknown_product(code: str) -> str:
    return f"{code} is not in the catalogue: give its name as well (--name), or import it (tms catalogue import)."


def summary(registered: int, already: int, failed: int) -> str:
    things = "1 thing" if registered == 1 else f"{registered} things"
    parts = [f"{things} registered"]
    parts += [f"{already} registered already"] if already else []
    parts += [f"{failed} not registered"] if failed else []
    return ", ".join(parts) + "."


def why_not(error: TownError, tag: str, room: str | None, known: TownObject | None = None) -> str:
    """Why ``tag`` was not registered; ``known`` is what it is registered as, in a conflict."""
    where = f"room {room}" if room else "things without a room"
    match error:
        case Unreachable():
            return f"Not registered: the server does not answer. Tag {tag} has to be done again. ({error})"
        case Unauthenticated():
            return "Not registered: the server wants a key, or does not know this one (--key or TMS_KEY)."
        case Forbidden():
            return f"Not registered: this key has no right to register for {where}."
        case Conflict() if known is not None:
            return f"Not registered: tag {tag} belongs to something else already: {thing(known)}."
        case Conflict() | Invalid():
            return f"Not registered: {_reason(error)}."
        case _:
            return f"Not registered: {error}."


def _reason(error: Conflict | Invalid) -> str:
    return (error.problem.detail or error.problem.title).removeprefix("jan: ").rstrip(".")
