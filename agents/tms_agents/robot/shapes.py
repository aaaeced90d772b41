"""What the robot knows of tagged things: it asks the server by tag (a tag is a pointer: SLAM-SD, section 2.2)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

import numpy as np

from tms_agents.slam.semidynamic import ObjectModel
from tms_client import NotFound, Town, TownError
from tms_schemas.objects import ObjectModel as Described

#: A tag that the server does not know is asked for again after so long: it may be registered by then.
_AGAIN_S = 60.0


class Shapes:
    """``say`` is told which tags are left out, and why, once for each reason."""

    def __init__(self, town: Town, say: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        self._town, self._say, self._clock = town, say, clock
        self.known: dict[str, ObjectModel] = {}
        self._unknown: dict[str, float] = {}
        self._said: dict[str, str] = {}

    def learn(self, tags: Iterable[str]) -> None:
        """Ask for those that are not known yet; through an outage of the server, later."""
        for tag in sorted(set(tags) - self.known.keys()):
            if self._clock() < self._unknown.get(tag, -np.inf):
                continue
            try:
                found = model_of(self._town.objects.model(tag))
            except NotFound as error:
                self._unknown[tag] = self._clock() + _AGAIN_S
                self._once(tag, str(error))
            except ValueError as error:
                self._unknown[tag] = self._clock() + _AGAIN_S
                self._once(tag, str(error))
            except TownError as error:
                self._once(tag, str(error))
                return  # the others would wait as long for nothing
            else:
                self.known[tag] = found

    def _once(self, tag: str, why: str) -> None:
        if self._said.get(tag) != why:
            self._said[tag] = why
            self._say(f"tag {tag} is left out: {why}")


def model_of(described: Described) -> ObjectModel:
    """As the estimator takes it; what has no parts is seen as its polygon. Raises ``ValueError`` without a tag pose."""
    if described.tag_pose is None:
        raise ValueError(f"nobody told where the tag is on {described.tag}")
    parts = tuple(np.array(part, dtype=np.float64) for part in described.parts or [described.polygon])
    return ObjectModel(described.class_, parts, np.array(described.tag_pose, dtype=np.float64))
