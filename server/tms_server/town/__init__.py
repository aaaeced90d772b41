"""Room actors: belief = fold(log), snapshots, queries.

What others use of ``Town`` (``request.state.town``):

* ``await town.belief(room, at=None, known_at=None) -> RoomView``: the room at one instant (datetimes, UTC), immutable.
  ``at=None`` is the newest state and knows every record committed before the call. ``RoomView`` (``town.views``) makes
  the answers: ``location(tag)``, ``placements()``, ``labels()``, ``movers()``, ``anomalies()``; ``cursor`` is its log
  offset. NotFound where there is no such room.
* ``async with town.subscribe(room) as changes: async for head in changes``: the newest folded offset, each time the
  room's state changed, latest wins (a slow reader skips, it never misses the last). The first one comes at once.
* ``await town.records(room, after, limit) -> list[Record]``: log records by offset, for lossless event frames.
* ``town.poke(room)``: the room's log has new records. The unit of work (``db.session``) does this by itself after
  every commit that called ``log.registry.append_registry``.
"""

from __future__ import annotations

from tms_server.town.town import Town, open_town
from tms_server.town.views import RoomView

__all__ = ["RoomView", "Town", "open_town"]
