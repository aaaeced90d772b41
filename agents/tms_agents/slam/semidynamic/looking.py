"""A visit with all that was seen and read during it."""

from __future__ import annotations

import numpy as np

from tms_agents.slam.geometry import Floats, compose
from tms_agents.slam.logs import Log
from tms_agents.slam.semidynamic.evidence import Place, count_beams, worth
from tms_agents.slam.semidynamic.models import Models
from tms_agents.slam.semidynamic.reads import Rounds
from tms_agents.slam.semidynamic.scoring import Heard, Sight
from tms_agents.slam.semidynamic.visits import Visit

#: Around the places where a tag was read (m): the reach of an antenna, and an object.
_AROUND_M = 3.2
#: Of the rounds that did not read a tag, one in so many is looked at, for all of them.
_EVERY = 4
#: So many scans of other times are enough to tell what is always there.
_OTHERS = 500


def sight_of(visit: Visit, log: Log, poses: Floats, rounds: Rounds, round_poses: Floats, models: Models) -> Sight:
    """``poses`` (S, 3) of the robot at the scans of ``log``, ``round_poses`` (R, 3) at ``rounds``."""
    read = rounds.read(visit.tag)
    read_from = round_poses[visit.rounds][read[visit.rounds]]
    place = Place.around(read_from if visit.reads else visit.middle[None], _AROUND_M)
    now = count_beams(place, log, poses, visit.scans)
    near = place.distance(poses[:, :2]) < log.range_max
    near[visit.scans] = False
    elsewhen = np.flatnonzero(near)
    other = count_beams(place, log, poses, elsewhen[:: 1 + len(elsewhen) // _OTHERS])
    heard = []
    for number, antenna in models.antennas.items():
        mine = visit.rounds[rounds.antenna[visit.rounds] == number]
        got, missed = mine[read[mine]], mine[~read[mine]][::_EVERY]
        heard.append(Heard(antenna, _on_robot(round_poses[got], antenna.pose), read=True))
        heard.append(Heard(antenna, _on_robot(round_poses[missed], antenna.pose), read=False, weight=_EVERY))
    return Sight(place, worth(now, other), heard)


def _on_robot(poses: Floats, part: Floats) -> Floats:
    return compose(poses, np.broadcast_to(part, poses.shape))
