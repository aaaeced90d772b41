"""What the hand agent must still know after a restart: a small JSON file beside the spool."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

from tms_agents.hand.robot import Robot
from tms_schemas.rooms import Room

log = logging.getLogger(__name__)


class Memory:
    """``robot`` and the last known ``room``. A file that cannot be read is said and left out: the agent works on."""

    def __init__(self, spool: Path) -> None:
        self._path = spool.with_name(spool.name + ".hands.json")
        self._kept: dict[str, Any] = {}

    def load(self, robot: Robot) -> Room | None:
        """Restore the robot; returns the room as it was last known."""
        try:
            kept = json.loads(self._path.read_text(encoding="utf-8"))
            if kept.get("robot") is not None:
                robot.restore(kept["robot"])
            room = None if kept.get("room") is None else Room.model_validate(kept["room"])
        except FileNotFoundError:
            return None
        except (OSError, ValueError, AttributeError) as error:
            log.warning("%s: %s; what the hands held before is not known", self._path, error)
            return None
        self._kept = kept
        return room

    def keep_robot(self, robot: Robot) -> None:
        self._write(robot=robot.to_dict())

    def keep_room(self, room: Room) -> None:
        self._write(room=room.model_dump(mode="json"))

    def _write(self, **new: Any) -> None:
        if all(self._kept.get(name) == value for name, value in new.items()):
            return
        self._kept |= new
        whole = self._path.with_name(self._path.name + ".new")
        try:
            whole.write_text(json.dumps(self._kept), encoding="utf-8")
            whole.replace(self._path)  # a reader sees the old file or the new one
        except OSError as error:
            log.error("%s: %s; after a restart it is not known what the hands hold", self._path, error)
