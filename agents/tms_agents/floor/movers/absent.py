"""People who are not seen and may be there: far from every door nobody goes, and in a door some turn round."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tms_agents.floor.association.identity import likeness
from tms_agents.floor.events import FloorEvent, Vanished
from tms_agents.floor.feet.left_feet import has_left
from tms_agents.floor.feet.prints import thin
from tms_agents.floor.movers.doors import Doors
from tms_agents.floor.scan.masks import Area
from tms_agents.floor.state import BODY, CONCEALED, SEATED, empty, pack, unpack

Array = NDArray[np.float64]

#: Who was seen for so many scans is somebody.
_SOMEBODY = 30
#: Who was lost turns up within so far (m), and so much farther each second (m/s), and is waited for so long (s); rather
#: one who was lost so lately (s).
_AWAY_M, _SPEED, _WAIT_S, _LATELY_S = 1.0, 1.0, 60.0, 20.0
#: Who was seen last so far (m) on this side of the threshold may have turned round; then he is seen again within this
#: (s), and believed so long (s) after that at most.
_THRESHOLD_M, _TURNS_S, _BELIEVED_S = 0.25, 6.0, 1.5
#: Who seemed to sit down so lately (s) may have gone on, who seemed to go out where no door is told so lately (s).
_PASSES_S, _ROUND_S = 6.0, 3.0
#: So near (m) where he was lost he may stand, since so long (s) before that at most.
_STEPS_M, _JUST_S = 1.2, 4.0
#: Of who stands among others a part is hidden now and then: what is always seen whole is no foot of his, unless it is
#: as wide (m) as a shoe from its side; nor is an edge of something, so wide (m), nor what is so near (m) somebody seen.
_SIDE_M, _EDGE_M, _BESIDE_M = 0.17, 0.02, 0.45
#: Who looks and walks as unlikely as this (log likelihood) is somebody else.
_UNLIKE = -6.0


class Absent:
    """``gates``: the doors of ``region``; where none is told, `Doors` learns where people come and go."""

    def __init__(self, gates: Area, region: Area) -> None:
        self.doors, self._region = Doors(gates), region
        self._bodies: list[Any] = []
        self._turning: list[Any] = []
        #: Whether somebody was waited for in vain.
        self._missed = False

    def keep(self, body: Any) -> Any:
        """This one, of whom nothing is seen any more, if he must or may be somewhere: he is waited for. Else None."""
        if self.doors.keeps(body):
            return self._wait(self._bodies, body)
        return self._wait(self._turning, body) if not self.doors.told and self.doors.known else None

    def turns(self, body: Any) -> Any:
        """This one, who seems to have gone out, if he may have turned round in the door: he is waited for. Else None.

        Whoever goes out is seen last on the threshold.
        """
        if not self.doors.told:
            return None
        foot = "a" if body["a_seen"] > body["b_seen"] else "b"
        x, y = float(body[f"{foot}x"]), float(body[f"{foot}y"])
        kept = self._wait(self._turning, body) if self._region.depth(x, y) >= _THRESHOLD_M else None
        if kept is not None:
            kept["x"], kept["y"] = x, y
        return kept

    @staticmethod
    def _wait(lost: list[Any], body: Any) -> Any:
        if body["hits"] < _SOMEBODY or body["robot"] or body["wide"] >= 0.3:
            return None
        lost.append(body.copy())
        lost[-1]["stale"] = CONCEALED
        return lost[-1]

    @property
    def bodies(self) -> list[Any]:
        """Those who are waited for (`state.BODY`)."""
        return [*self._bodies, *self._turning]

    @property
    def waits(self) -> bool:
        """Whether anybody is waited for."""
        return bool(self._bodies)

    def save(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "waiting": pack(np.array(self._bodies, BODY)),
            "turning": pack(np.array(self._turning, BODY)),
            "doors": self.doors.save(),
            "missed": self._missed,
        }

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        waiting, turning = (saved[name] for name in ("waiting", "turning"))
        self._bodies = list(unpack(waiting, empty(BODY, int(waiting["shape"][0]))))
        self._turning = list(unpack(turning, empty(BODY, int(turning["shape"][0]))))
        self.doors.restore(saved["doors"])
        self._missed = bool(saved["missed"])

    def find(self, body: Any, scattered: Array) -> Any:
        """Who of those waited for this new one most probably is, or None; ``scattered`` (3,) as `likeness` takes."""
        inside = self.inside(body)
        turning = self._turning if inside or self.doors.told else []
        for lost, within_s in ((turning, self._turns_s), (self._bodies if inside else [], _WAIT_S)):
            index = self._likeliest(lost, body, scattered, within_s)
            if index is not None:
                return lost.pop(index)
        return None

    def rises(self, bodies: Any, body: Any, scattered: Array) -> int | None:
        """Which of the ``bodies`` (n,), who seemed to sit down, is this new one: he went on where nobody saw it."""
        return self._of(bodies, SEATED, body, scattered, _PASSES_S)

    def comes_out(self, bodies: Any, body: Any, scattered: Array) -> int | None:
        """The same of those who seemed to be hidden: he has walked on behind others."""
        return self._of(bodies, CONCEALED, body, scattered, _WAIT_S)

    def _of(self, bodies: Any, stale: int, body: Any, scattered: Array, within_s: float) -> int | None:
        """Which of the ``bodies`` (n,) that are ``stale`` in this way the new one most probably is, or None."""
        if not self.inside(body):
            return None
        there = (bodies["used"] == 1) & (bodies["confirmed"] == 1) & (bodies["robot"] == 0)
        those = np.flatnonzero(there & (bodies["stale"] == stale))
        index = self._likeliest([bodies[i] for i in those], body, scattered, within_s)
        return None if index is None else int(those[index])

    def inside(self, body: Any) -> bool:
        """Whether the new one began too far from the doors, where they are known, to have come in."""
        return self.doors.inside(float(body["x0"]), float(body["y0"]))

    def enters(self, body: Any) -> bool:
        """Whether the new one began at a door."""
        return self.doors.enters(float(body["x0"]), float(body["y0"]))

    def came(self, body: Any, alone: bool) -> None:
        """The new one is nobody of those waited for; ``alone``: nobody is hidden or seated who might be he."""
        nobody = alone and not self._bodies and not self._turning and not self._missed
        self.doors.came(float(body["x0"]), float(body["y0"]), nobody)

    @staticmethod
    def _likeliest(lost: list[Any], body: Any, scattered: Array, within_s: float) -> int | None:
        """Which of those ``lost``, this long ago at most, the body most probably is, or None."""
        best, best_cost = None, math.inf
        for index, one in enumerate(lost if body["wide"] <= 0.3 else []):
            since = max(0.0, float(body["first"]) - float(one["seen"]))
            gap = math.hypot(body["x0"] - one["x"], body["y0"] - one["y"]) / (_AWAY_M + _SPEED * since)
            likely = float(likeness(body, one, scattered))
            cost = 0.5 * gap + 0.5 * likely / _UNLIKE + (since > _LATELY_S)
            if since < within_s and gap < 1.0 and likely > _UNLIKE and cost < best_cost:
                best, best_cost = index, cost
        return best

    def standing(self, print_: Any, bodies: Any) -> Any:
        """Who of them most probably stands on the print, and nobody else does: or None."""
        seen = bodies[(bodies["used"] == 1) & (bodies["confirmed"] == 1) & (bodies["stale"] == 0)]
        beside = np.hypot(seen["x"] - print_["x"], seen["y"] - print_["y"]) < _BESIDE_M
        if print_["width"] < _EDGE_M or beside.any():
            return None
        return min(self._near(print_, bodies), key=lambda one: _away(print_, one), default=None)

    def found(self, body: Any) -> None:
        """This one of them is there again."""
        self._bodies = [one for one in self._bodies if one is not body]

    def _near(self, print_: Any, bodies: Any) -> list[Any]:
        """Of those who have not turned up: beside whose place the print came since; none if it is hardly a foot."""
        in_view = print_["whole"] == print_["hits"] and print_["width"] < _SIDE_M
        if in_view or thin(print_) or has_left(print_, bodies):
            return []
        came = [one for one in self._bodies if print_["rested"] > one["seen"] - _JUST_S]
        return [one for one in came if _away(print_, one) < _STEPS_M]

    @property
    def _turns_s(self) -> float:
        """How long (s) who seems to have gone out may turn round."""
        return _TURNS_S if self.doors.told else _ROUND_S

    def gone(self, t: float) -> list[FloorEvent]:
        """Those who did not turn up."""
        events: list[FloorEvent] = []
        for lost, wait_s in ((self._bodies, _WAIT_S), (self._turning, self._turns_s + _BELIEVED_S)):
            if not lost:
                continue
            late = [one for one in lost if t - one["seen"] > wait_s]
            if not late:
                continue
            self._missed |= lost is self._bodies
            events += [Vanished(t, int(one["label"]), float(one["seen"]), t) for one in late]
            lost[:] = [one for one in lost if t - one["seen"] <= wait_s]
        return events


def _away(print_: Any, one: Any) -> float:
    return math.hypot(print_["x"] - one["x"], print_["y"] - one["y"])
