"""What the estimator remembers between scans, as plain records that the kernels work on."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

#: Something that has stood at one place for a moment: a standing foot, an object not yet believed, a table's leg.
#: (x, y) m mean of where it was seen, first time seen since it was hidden, since when it has rested there, hidden or
#: not, last time seen, hits, looks and mutes (scans since that hit it, that could have, that saw nothing at all there;
#: of those that hit it, that saw all of it, and only what something new before it left), width m, spread m (mean
#: distance from the mean), attached (in which share of the last twenty sightings or so it was joined to the
#: background), owner (index of the body whose foot it is, -1: nobody's), whose (label of the last one, until owned),
#: busy (when a body was last near),
#: spare (s for which somebody beside it has shown two other feet), idle (s for which it was seen as nobody's foot),
#: alone (s for which it was all that was seen of its owner), silent and hidden (when nothing at all came back from
#: there, though something should, and when something new stood before it),
#: revealed (`furniture.LOOKS`, `furniture.MOVED`), how bright it is (`shine.measure`) and of how many sightings,
#: beams of the last sighting.
PRINT = np.dtype(
    [
        ("used", "i8"),
        ("x", "f8"),
        ("y", "f8"),
        ("first", "f8"),
        ("rested", "f8"),
        ("last", "f8"),
        ("hits", "i8"),
        ("looks", "i8"),
        ("mutes", "i8"),
        ("whole", "i8"),
        ("covered", "i8"),
        ("width", "f8"),
        ("spread", "f8"),
        ("beams", "f8"),
        ("near", "f8"),
        ("spacing", "f8"),
        ("attached", "f8"),
        ("owner", "i8"),
        ("whose", "i8"),
        ("owned", "f8"),
        ("busy", "f8"),
        ("revealed", "i8"),
        ("given", "i8"),
        ("spare", "f8"),
        ("idle", "f8"),
        ("alone", "f8"),
        ("silent", "f8"),
        ("hidden", "f8"),
        ("still_x", "f8"),
        ("still_y", "f8"),
        ("still", "f8"),
        ("shine", "f8"),
        ("shine_n", "i8"),
        ("sensor", "i8"),
        ("first_beam", "i8"),
        ("last_beam", "i8"),
    ]
)

#: Of a body that is not seen (stale): it is hidden, or it has sat down.
CONCEALED, SEATED = 1, 2

#: A body that moves: position and velocity (m, m/s) with one covariance for both axes (pp, pv, vv), where it began, and
#: two feet: where and when each was last seen and which print it stands on (-1: in the air or unknown). What tells
#: people apart is there three times: of the body in the last seconds (shine), of the body since it was last in doubt
#: who it is (look, pace, girth, sole), and of the one whose name it has (own, own_pace, own_girth, own_sole); sure is
#: how likely that name is. Further: the number of its `FOOTPRINT` (0: none), for how long (s) and where it has stood on
#: one foot alone (lone), for how long what it stands on had been nobody's before (older, s), where and since when it
#: has stayed (rest), where, more widely, and for how long it was seen there (stay, s), broader and thinner than feet
#: (stay_broad, stay_thin, s), how often feet landed there (stay_lands), how broad (m) the broader of what was seen of
#: it last is (broadest), and how far apart beams are there (spacing), how wide the legs are (m, 0: unknown),
#: whether what is seen of it is no foot, and why (odd, `prints.UNLIKE`), the line on which the shoe last seen from its
#: side lay (ex, ey), and when (e_at), in how many scans both feet had been seen (both) when it was last found to be
#: nowhere (doubted), until when it stays where it was put back (held, s), and when somebody began to be seen, far from
#: every door, who may be who it was (suspected). Of one not believed yet: in how many scans it was seen (hits), could
#: have been (looks), and was or should have been (due). First all that has to do with whose foot a cluster is.
_OF_FEET = [
    ("used", "i8"),
    ("confirmed", "i8"),
    ("label", "i8"),
    ("robot", "i8"),
    ("machine", "i8"),
    ("footprint", "i8"),
    ("stale", "i8"),
    ("x", "f8"),
    ("y", "f8"),
    ("vx", "f8"),
    ("vy", "f8"),
    ("pp", "f8"),
    ("pv", "f8"),
    ("vv", "f8"),
    ("at", "f8"),
    ("first", "f8"),
    ("seen", "f8"),
    ("hits", "i8"),
    ("looks", "i8"),
    ("due", "i8"),
    ("both", "i8"),
    ("x0", "f8"),
    ("y0", "f8"),
    ("width", "f8"),
    ("wide", "f8"),
    ("far", "f8"),
    ("ax", "f8"),
    ("ay", "f8"),
    ("a_seen", "f8"),
    ("a_since", "f8"),
    ("a_print", "i8"),
    ("bx", "f8"),
    ("by", "f8"),
    ("b_seen", "f8"),
    ("b_since", "f8"),
    ("b_print", "i8"),
    ("from_furniture", "i8"),
    ("score", "f8"),
    ("a_vx", "f8"),
    ("a_vy", "f8"),
    ("b_vx", "f8"),
    ("b_vy", "f8"),
    ("stride", "f8"),
    ("side", "f8"),
    ("a_px", "f8"),
    ("a_py", "f8"),
    ("a_ox", "f8"),
    ("a_oy", "f8"),
    ("a_land", "f8"),
    ("a_stood", "f8"),
    ("b_px", "f8"),
    ("b_py", "f8"),
    ("b_ox", "f8"),
    ("b_oy", "f8"),
    ("b_land", "f8"),
    ("b_stood", "f8"),
    ("a_late", "f8"),
    ("b_late", "f8"),
    ("shoe", "f8"),
    ("leg", "f8"),
    ("ex", "f8"),
    ("ey", "f8"),
    ("e_at", "f8"),
    ("shine", "f8"),
    ("shine_n", "i8"),
    ("own", "f8"),
    ("own_n", "i8"),
    ("own_pace", "f8"),
    ("own_pace_n", "i8"),
    ("own_girth", "f8"),
    ("own_girth_n", "i8"),
    ("own_sole", "f8"),
    ("own_sole_n", "i8"),
    ("doubted", "i8"),
    ("held", "f8"),
]
#: The same: what has nothing to do with whose foot a cluster is.
_BESIDES = [
    ("told_x", "f8"),
    ("told_y", "f8"),
    ("clear", "f8"),
    ("lone", "f8"),
    ("lone_x", "f8"),
    ("lone_y", "f8"),
    ("rest_x", "f8"),
    ("rest_y", "f8"),
    ("rest_at", "f8"),
    ("pushed", "f8"),
    ("stay_x", "f8"),
    ("stay_y", "f8"),
    ("stay", "f8"),
    ("stay_broad", "f8"),
    ("stay_thin", "f8"),
    ("stay_lands", "f8"),
    ("broadest", "f8"),
    ("spacing", "f8"),
    ("quality", "f8"),
    ("single", "f8"),
    ("still", "f8"),
    ("older", "f8"),
    ("odd", "i8"),
    ("suspected", "f8"),
]
#: And what was seen of it since it was last in doubt who it is: another doubt, another time.
_LATELY = [
    ("look", "f8"),
    ("look_n", "i8"),
    ("pace", "f8"),
    ("pace_n", "i8"),
    ("girth", "f8"),
    ("girth_n", "i8"),
    ("sole", "f8"),
    ("sole_n", "i8"),
    ("sure", "f8"),
]
BODY = np.dtype([*_OF_FEET, *_BESIDES, *_LATELY])
#: A body as integers, each field as long as one: so many of the first have to do with whose foot a cluster is, so many
#: with anything but a doubt.
FEET, CERTAIN = len(_OF_FEET), len(_OF_FEET) + len(_BESIDES)

#: A robot of known size, or what may be one: whether it is (sure), which body it is (-1: none), where it is (m), its
#: yaw and velocity (m/s), half its length and width (a, b, m), since when, when it was seen and when it was looked for
#: last, in how many scans it was seen, where it began, for which share of its way a person was beside it (pushed), how
#: far (m) it has gone since with nobody there (alone), how well it fits in the mean, 0 to 1, and whether it was going.
FOOTPRINT = np.dtype(
    [
        ("used", "i8"),
        ("sure", "i8"),
        ("body", "i8"),
        ("x", "f8"),
        ("y", "f8"),
        ("yaw", "f8"),
        ("vx", "f8"),
        ("vy", "f8"),
        ("a", "f8"),
        ("b", "f8"),
        ("first", "f8"),
        ("seen", "f8"),
        ("at", "f8"),
        ("hits", "i8"),
        ("x0", "f8"),
        ("y0", "f8"),
        ("pushed", "f8"),
        ("alone", "f8"),
        ("fits", "f8"),
        ("going", "i8"),
    ]
)

#: An object: place (m) and its variance (m²), half its width, times, for how long its place was seen to be free, and
#: how far aside of its middle (m, along the beams), by which sensor and how often, it is met while half hidden.
THING = np.dtype(
    [
        ("used", "i8"),
        ("label", "i8"),
        ("x", "f8"),
        ("y", "f8"),
        ("var", "f8"),
        ("half", "f8"),
        ("since", "f8"),
        ("seen", "f8"),
        ("hits", "i8"),
        ("free", "f8"),
        ("free_at", "f8"),
        ("doubt", "f8"),
        ("rate", "f8"),
        ("solid", "f8"),
        ("part", "f8"),
        ("part_by", "i8"),
        ("part_hits", "i8"),
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
