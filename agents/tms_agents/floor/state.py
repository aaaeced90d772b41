"""What the estimator remembers between scans, as plain records that the kernels work on."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

#: When what has not happened yet did (s): before every time, also of clocks that begin below zero.
NEVER = -1e9

#: Something that has stood at one place for a moment: a standing foot, an object not yet believed, a table's leg.
PRINT = np.dtype(
    [
        ("used", "i8"),
        ("x", "f8"),  # m, mean of where it was seen
        ("y", "f8"),
        ("first", "f8"),  # s, when it was first seen since it was hidden
        ("rested", "f8"),  # s, since when it has rested there, hidden or not
        ("last", "f8"),  # s, when it was last seen
        ("hits", "i8"),  # scans that hit it
        ("looks", "i8"),  # scans that could have,
        ("mutes", "i8"),  # scans to which nothing at all came back from there
        ("whole", "i8"),  # of those that hit it: that saw all of it
        ("covered", "i8"),  # of those that hit it: that saw what something new before it leaves of it
        ("width", "f8"),  # m
        ("spread", "f8"),  # m, mean distance from the mean
        ("beams", "f8"),  # of a sighting, in the mean
        ("near", "f8"),  # m, how far it is from the laser
        ("spacing", "f8"),  # m, how far apart beams are there
        ("missed", "f8"),  # share of the scans, of late, in which nothing was seen of it
        ("attached", "f8"),  # share of the last twenty sightings in which it was joined to the background
        ("owner", "i8"),  # body whose foot it is, -1: nobody's
        ("whose", "i8"),  # label of the last one
        ("owned", "f8"),  # s, until when
        ("busy", "f8"),  # s, when a body was last near
        ("revealed", "i8"),  # as a part of the room: `furniture.LOOKS`, `furniture.MOVED`
        ("given", "i8"),  # 1: a hand has put it there
        ("spare", "f8"),  # s for which somebody beside it has shown two other feet
        ("idle", "f8"),  # s for which it was seen as nobody's foot
        ("alone", "f8"),  # s for which it was all that was seen of its owner
        ("silent", "f8"),  # s, when nothing came back from there, though something should
        ("hidden", "f8"),  # s, when something new stood before it
        ("still_x", "f8"),  # m, where it has not moved
        ("still_y", "f8"),
        ("still", "f8"),  # s, since when
        ("shine", "f8"),  # how bright it is (`brightness.measure`)
        ("shine_n", "i8"),  # of how many sightings
        ("sensor", "i8"),  # of the last sighting: by which sensor
        ("first_beam", "i8"),  # from which beam
        ("last_beam", "i8"),  # to which
    ]
)

#: Of a body that is not seen (stale): it is hidden, or it has sat down.
CONCEALED, SEATED = 1, 2

#: A body that moves, on two feet. What tells people apart is there three times: of the body in the last seconds
#: (shine), of the body since it was last in doubt who it is (`_LATELY`), and of the one whose name it has (own). First
#: all that has to do with whose foot a cluster is.
_OF_FEET = [
    ("used", "i8"),
    ("confirmed", "i8"),  # 1: it is believed, a mover
    ("label", "i8"),
    ("robot", "i8"),  # 1: it is broad, or a machine: no person
    ("machine", "i8"),  # 1: it has gone by itself, and is as broad as a robot
    ("footprint", "i8"),  # number of its `FOOTPRINT`, 0: none
    ("stale", "i8"),  # not seen: `CONCEALED`, `SEATED`
    ("x", "f8"),  # m
    ("y", "f8"),
    ("vx", "f8"),  # m/s
    ("vy", "f8"),
    ("pp", "f8"),  # covariance of place and velocity, the same of both axes
    ("pv", "f8"),
    ("vv", "f8"),
    ("at", "f8"),  # s, the time of all this
    ("first", "f8"),  # s, when it was first seen
    ("seen", "f8"),  # s, when it was last seen
    ("hits", "i8"),  # scans in which it was seen
    ("looks", "i8"),  # scans that were looked for its feet in
    ("due", "i8"),  # scans in which it was or should have been seen, while it is not believed
    ("both", "i8"),  # scans in which both feet were seen
    ("x0", "f8"),  # m, where it began
    ("y0", "f8"),
    ("width", "f8"),  # m, of what is seen of it, in the mean
    ("wide", "f8"),  # share of late in which that was too wide for a foot
    ("far", "f8"),  # m, the most it was
    ("ax", "f8"),  # m, where the first foot was seen last
    ("ay", "f8"),
    ("a_seen", "f8"),  # s, when that was
    ("a_since", "f8"),  # s, since when its print is there
    ("a_print", "i8"),  # on which print it stands, -1: in the air or unknown
    ("bx", "f8"),  # the second foot, the same
    ("by", "f8"),
    ("b_seen", "f8"),
    ("b_since", "f8"),
    ("b_print", "i8"),
    ("from_furniture", "i8"),  # 1: it began as a piece of furniture, -1: it is none
    ("score", "f8"),  # how much all sightings looked like feet (`bodies.footlike`)
    ("a_vx", "f8"),  # m/s, of the foot that swings
    ("a_vy", "f8"),
    ("b_vx", "f8"),
    ("b_vy", "f8"),
    ("stride", "f8"),  # m, from foot to foot
    ("side", "f8"),  # m, how far to the left of the first the second one is
    ("a_px", "f8"),  # m, where the first foot stands, or stood last
    ("a_py", "f8"),
    ("a_ox", "f8"),  # m, where before that
    ("a_oy", "f8"),
    ("a_land", "f8"),  # s, when it landed
    ("a_stood", "f8"),  # s, when it was last seen to stand
    ("b_px", "f8"),  # the second foot, the same
    ("b_py", "f8"),
    ("b_ox", "f8"),
    ("b_oy", "f8"),
    ("b_land", "f8"),
    ("b_stood", "f8"),
    ("a_late", "f8"),  # s into the sweep when the first foot was seen
    ("b_late", "f8"),  # and the second foot
    ("shoe", "f8"),  # share of late in which a foot was as wide as a shoe from its side
    ("leg", "f8"),  # m, how wide a foot is while it walks, 0: unknown
    ("ex", "f8"),  # direction in which the shoe last seen from its side lay
    ("ey", "f8"),
    ("e_at", "f8"),  # s, when that was
    ("shine", "f8"),  # how bright it is, in the last seconds
    ("shine_n", "i8"),  # of how many sightings
    ("own", "f8"),  # of the one whose name it has: how bright
    ("own_n", "i8"),
    ("own_stance", "f8"),  # how long a stance takes (s)
    ("own_stance_n", "i8"),
    ("own_leg_width", "f8"),  # how wide a leg is (m)
    ("own_leg_width_n", "i8"),
    ("own_shoe_length", "f8"),  # how long a shoe (m)
    ("own_shoe_length_n", "i8"),
    ("doubted", "i8"),  # ``both`` when it was last found to be nowhere
    ("held", "f8"),  # s, until when it stays where it was put back
]
#: The same: what has nothing to do with whose foot a cluster is.
_BESIDES = [
    ("told_x", "f8"),  # m, where it was told last
    ("told_y", "f8"),
    ("clear", "f8"),  # s for which its place was seen without it
    ("lone", "f8"),  # s for which it has stood on one foot alone
    ("lone_x", "f8"),  # m, where
    ("lone_y", "f8"),
    ("walked_x", "f8"),  # m, where it was when it was last seen to go on two feet, or where it began
    ("walked_y", "f8"),
    ("rest_x", "f8"),  # m, where it has stayed
    ("rest_y", "f8"),
    ("rest_at", "f8"),  # s, since when
    ("pushed", "f8"),  # share of its way, of late, on which a person was beside it
    ("stay_x", "f8"),  # m, where it has stayed more widely
    ("stay_y", "f8"),
    ("stay", "f8"),  # s for which it was seen there
    ("stay_broad", "f8"),  # s of these in which it was broader than feet
    ("stay_thin", "f8"),  # s of these in which it was thinner
    ("stay_lands", "f8"),  # how often feet landed there
    ("broadest", "f8"),  # m, the broader of what was seen of it last
    ("spacing", "f8"),  # m, how far apart beams are there
    ("missed", "f8"),  # share of the scans, of late, in which nothing was seen of it
    ("quality", "f8"),  # how much what is seen of it looks like feet, of late
    ("single", "f8"),  # s for which one thing is all that is seen of it
    ("still", "f8"),  # s for which neither foot has moved
    ("older", "f8"),  # s for which what it stands on had been nobody's before
    ("odd", "i8"),  # why that is no foot of its: `prints.UNLIKE`, 0: it may be
    ("suspected", "f8"),  # s, when somebody began, far from every door, who may be who it was
]
#: And what was seen of it since it was last in doubt who it is: another doubt, another time.
_LATELY = [
    ("look", "f8"),  # how bright it is
    ("look_n", "i8"),
    ("stance", "f8"),  # how long a stance takes (s)
    ("stance_n", "i8"),
    ("leg_width", "f8"),  # how wide a leg is (m)
    ("leg_width_n", "i8"),
    ("shoe_length", "f8"),  # how long a shoe (m)
    ("shoe_length_n", "i8"),
    ("sure", "f8"),  # how likely its name is
]
BODY = np.dtype([*_OF_FEET, *_BESIDES, *_LATELY])
#: A body as integers, each field as long as one: so many of the first have to do with whose foot a cluster is, so many
#: with anything but a doubt.
FEET, CERTAIN = len(_OF_FEET), len(_OF_FEET) + len(_BESIDES)

#: A robot of known size, or what may be one.
FOOTPRINT = np.dtype(
    [
        ("used", "i8"),
        ("sure", "i8"),  # 1: it is a robot, 0: it may be one
        ("body", "i8"),  # which body it is, -1: none
        ("x", "f8"),  # m, its middle
        ("y", "f8"),
        ("yaw", "f8"),  # rad
        ("vx", "f8"),  # m/s
        ("vy", "f8"),
        ("a", "f8"),  # m, half its length
        ("b", "f8"),  # m, half its width
        ("first", "f8"),  # s, since when it is there
        ("seen", "f8"),  # s, when it was seen last
        ("at", "f8"),  # s, when it was looked for last
        ("hits", "i8"),  # scans in which it was seen
        ("x0", "f8"),  # m, where it began
        ("y0", "f8"),
        ("pushed", "f8"),  # share of its way on which a person was beside it
        ("alone", "f8"),  # m it has gone since with nobody there
        ("fits", "f8"),  # how well it fits, in the mean, 0 to 1
        ("going", "i8"),  # 1: it was going
    ]
)

#: An object.
THING = np.dtype(
    [
        ("used", "i8"),
        ("label", "i8"),
        ("x", "f8"),  # m, its middle
        ("y", "f8"),
        ("var", "f8"),  # m², of each axis
        ("half", "f8"),  # m, half its width
        ("since", "f8"),  # s, since when it lies there
        ("seen", "f8"),  # s, when it was seen last
        ("hits", "i8"),  # sightings of all of it
        ("free", "f8"),  # s for which its place was seen to be free
        ("free_at", "f8"),  # s, when it was last seen or seen past
        ("doubt", "f8"),  # how sure it is (negative log likelihood) that it has gone
        ("rate", "f8"),  # share of looks in which it echoes
        ("solid", "f8"),  # share of looks in which nothing is seen through it
        ("part", "f8"),  # m, how far aside of its middle it is met while half hidden
        ("part_by", "i8"),  # by which sensor
        ("part_hits", "i8"),  # how often
    ]
)


def empty(kind: np.dtype[Any], capacity: int | tuple[int, int]) -> Any:
    """An array of ``capacity`` unused records."""
    return np.zeros(capacity, kind)


def free_slot(records: Any) -> int:
    """Index of an unused record, -1 if all are used."""
    used = records["used"]
    index = int(used.argmin())
    return index if not used[index] else -1


def pack(array: Any) -> dict[str, Any]:
    """An array as JSON values, exactly."""
    return {
        "kind": array.dtype.descr if array.dtype.names else array.dtype.str,
        "shape": list(array.shape),
        "data": base64.b64encode(np.ascontiguousarray(array).tobytes()).decode(),
    }


def unpack(value: Any, like: Any) -> Any:
    """The array that `pack` gave.

    Raises:
        ValueError: not of the type and shape of ``like``, or damaged.
    """
    try:
        kind = value["kind"]
        expected = like.dtype.descr if like.dtype.names else like.dtype.str
        same = (
            [tuple(item) for item in kind] == [tuple(item) for item in expected]
            if isinstance(kind, list) and isinstance(expected, list)
            else kind == expected
        )
        if not same or tuple(value["shape"]) != like.shape:
            raise ValueError("the saved state of the floor estimator is of another sensor or version")
        data = base64.b64decode(value["data"], validate=True)
        return np.frombuffer(data, like.dtype).reshape(like.shape).copy()
    except (KeyError, TypeError) as error:
        raise ValueError(f"the saved state of the floor estimator is damaged: {error}") from None
