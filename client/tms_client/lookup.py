"""From what a person calls a thing to where it is."""

from __future__ import annotations

import re
import unicodedata
from datetime import datetime

from tms_client.answers import Location
from tms_client.api import Api
from tms_client.errors import Ambiguous, NotFound
from tms_client.flows import Flow
from tms_schemas.objects import TownObject
from tms_schemas.problem import Problem

_TAG = re.compile(r"[A-Za-z0-9._:-]{1,64}")
_HEX = re.compile(r"[0-9A-Fa-f]{8,64}")
_PAGE, _MOST = 200, 1000


def where(api: Api, name: str, at: datetime | None = None) -> Flow[Location]:
    """Location of the object with this tag, name or synonym.

    What looks like a tag (8 or more hex digits) is asked for as such first. Otherwise an exact name or synonym wins
    over a partial one; capitals and character width do not matter.

    Raises:
        Ambiguous: several objects fit equally well; the message names them.
        NotFound: none fits.
    """
    if _HEX.fullmatch(name):
        try:
            return (yield from api.location(name, at))
        except NotFound:
            pass
    found = yield from _search(api, name)
    if not found and _TAG.fullmatch(name):
        try:
            return (yield from api.location(name, at))
        except NotFound:
            pass
    return (yield from api.location(choose(name, found).tag, at))


def choose(name: str, found: list[TownObject]) -> TownObject:
    """The one object among the search results that ``name`` means.

    Raises:
        Ambiguous, NotFound: as ``where``.
    """
    wanted = _fold(name)
    exact = [one for one in found if wanted in map(_fold, [one.tag, one.name, *one.synonyms])]
    fits = exact or found
    if not fits:
        detail = f"no object is called {name!r}"
        raise NotFound(Problem(title="Not found", status=404, detail=detail))
    if len(fits) > 1:
        some = ", ".join(f"{one.name} ({one.tag})" for one in fits[:5])
        more = f" and {len(fits) - 5} more" if len(fits) > 5 else ""
        raise Ambiguous(f"{name!r} may be {some}{more}; ask with the tag", fits)
    return fits[0]


def _search(api: Api, name: str) -> Flow[list[TownObject]]:
    found: list[TownObject] = []
    cursor: str | None = None
    while len(found) < _MOST:
        page = yield from api.objects(q=name, limit=_PAGE, cursor=cursor)
        found += page.items
        cursor = page.next_cursor
        if cursor is None:
            break
    return found


def _fold(text: str) -> str:
    return " ".join(unicodedata.normalize("NFKC", text).casefold().split())
