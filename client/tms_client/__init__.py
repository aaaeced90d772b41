"""API library for robot code: where is the tea bottle?

from tms_client import Town

with Town("http://127.0.0.1:8080") as town:
    answer = town.where("tea bottle")
    print(answer.in_words())
"""

from tms_client.aio import AsyncTown
from tms_client.answers import Location
from tms_client.delivery import Pace
from tms_client.errors import (
    Ambiguous,
    BadAnswer,
    BadRequest,
    Busy,
    Conflict,
    Forbidden,
    Invalid,
    NotFound,
    Refused,
    ServerFault,
    SpoolError,
    SpoolFull,
    TooLarge,
    TownError,
    Unauthenticated,
    Unreachable,
)
from tms_client.flows import Retry
from tms_client.grasping import Gripper
from tms_client.hands import AsyncHand, Hand
from tms_client.maps.awaited import AsyncMap
from tms_client.maps.blocking import Map
from tms_client.posting import AsyncPoster, Poster
from tms_client.spool import DeadLetter, Spool
from tms_client.town import Town

__all__ = [
    "Ambiguous",
    "AsyncHand",
    "AsyncMap",
    "AsyncPoster",
    "AsyncTown",
    "BadAnswer",
    "BadRequest",
    "Busy",
    "Conflict",
    "DeadLetter",
    "Forbidden",
    "Gripper",
    "Hand",
    "Invalid",
    "Location",
    "Map",
    "NotFound",
    "Pace",
    "Poster",
    "Refused",
    "Retry",
    "ServerFault",
    "Spool",
    "SpoolError",
    "SpoolFull",
    "TooLarge",
    "Town",
    "TownError",
    "Unauthenticated",
    "Unreachable",
]
