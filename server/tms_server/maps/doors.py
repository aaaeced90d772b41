"""Which doors of a room are open: out of the newest versions of its maps."""

from __future__ import annotations

import json
import math
from datetime import datetime

from tms_schemas.base import Pose
from tms_schemas.maps import Door, DoorsAnswer, DoorState, MapObject
from tms_server.db.tables import MapRow
from tms_server.db.times import from_us
from tms_server.maps.reading import objects_of
from tms_server.maps.repository import MapRepository
from tms_server.maps.service import AnySession
from tms_server.objects.repository import ObjectFilter, ObjectRepository
from tms_server.objects.views import Stored, shape


async def doors_of(session: AnySession, room: str, state: DoorState | None) -> DoorsAnswer:
    """Of a door that is in several maps, what was seen last; ``state`` leaves out all others."""
    found: dict[str, Door] = {}
    for row in await MapRepository(session).of_room(room):
        objects = (await objects_of(session, row, None)).objects
        tags = [one.tag for one in objects]
        registered = {
            one.object.tag: one
            for one in await ObjectRepository(session).page_among(ObjectFilter(), tags, after=None, limit=len(tags))
        }
        told_at = from_us(await MapRepository(session).objects_made_at(row.map, row.version) or row.updated_at)
        for one in objects:
            if _is_door(one, registered.get(one.tag)):
                door = _door(row, one, registered.get(one.tag), told_at)
                if one.tag not in found or found[one.tag].seen_at < door.seen_at:
                    found[one.tag] = door
    return DoorsAnswer(doors=[found[tag] for tag in sorted(found) if state in (None, found[tag].state)])


def _is_door(one: MapObject, registered: Stored | None) -> bool:
    """By the class of its shape, or by what the robot says of it."""
    known = None if registered is None else shape(registered)
    return (known is not None and known.class_.startswith("door")) or one.state in ("open", "closed")


def _door(row: MapRow, one: MapObject, registered: Stored | None, told_at: datetime) -> Door:
    state: DoorState = "open" if one.state == "open" else "closed" if one.state == "closed" else "unknown"
    map_to_room: Pose | None = None if row.map_to_room is None else json.loads(row.map_to_room)
    pose = (one.x, one.y, one.theta)
    return Door(
        tag=one.tag,
        name=None if registered is None or registered.object.room not in (None, row.room) else registered.object.name,
        state=state,
        angle=one.angle,
        seen_at=one.seen_at or told_at,
        map=row.map,
        version=row.version,
        pose=pose,
        room_pose=None if map_to_room is None else _placed(map_to_room, pose),
    )


def _placed(frame: Pose, pose: Pose) -> Pose:
    """``pose`` in ``frame``, seen from where ``frame`` is given."""
    cos, sin = math.cos(frame[2]), math.sin(frame[2])
    x, y = frame[0] + cos * pose[0] - sin * pose[1], frame[1] + sin * pose[0] + cos * pose[1]
    return x, y, math.remainder(frame[2] + pose[2], math.tau)
