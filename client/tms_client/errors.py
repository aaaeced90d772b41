"""What can go wrong, as the caller sees it.

TownError
├── Unreachable            no answer: connection refused, cut or timed out
├── BadAnswer              an answer that is not the wire of this version
├── Ambiguous              a name that several objects carry (``candidates``)
├── SpoolError
│   └── SpoolFull          the spool holds as much as it may, or as its disk does
└── Refused                the server answered with an error (``status``, ``problem``)
    ├── BadRequest         400
    ├── Unauthenticated    401
    ├── Forbidden          403
    ├── NotFound           404
    ├── Conflict           409  (``items``)
    ├── TooLarge           413
    ├── Invalid            422  (``items``)
    ├── Busy               429, 502, 503, 504, 507  (``retry_after_s``)
    └── ServerFault        any other status
"""

from __future__ import annotations

from tms_schemas.objects import TownObject
from tms_schemas.problem import Problem, ProblemItem


class TownError(Exception):
    """Base of everything this library raises on purpose."""


class Unreachable(TownError):
    pass


class BadAnswer(TownError):
    pass


class Ambiguous(TownError):
    """``candidates`` are the objects the name may mean; ask again with a tag."""

    def __init__(self, message: str, candidates: list[TownObject]) -> None:
        super().__init__(message)
        self.candidates = candidates


class SpoolError(TownError):
    pass


class SpoolFull(SpoolError):
    pass


class Refused(TownError):
    """The server's problem body is ``problem``; ``items`` are the parts of the request it names."""

    def __init__(self, problem: Problem, *, retry_after_s: float | None = None) -> None:
        named = "; ".join(f"{item.where}: {item.why}" for item in problem.items[:5])
        text = ": ".join(part for part in (problem.detail or problem.title, named) if part)
        super().__init__(f"{problem.status} {text}")
        self.problem = problem
        self.status = problem.status
        self.retry_after_s = retry_after_s

    @property
    def items(self) -> list[ProblemItem]:
        return self.problem.items


class BadRequest(Refused):
    pass


class Unauthenticated(Refused):
    pass


class Forbidden(Refused):
    pass


class NotFound(Refused):
    pass


class Conflict(Refused):
    pass


class TooLarge(Refused):
    pass


class Invalid(Refused):
    pass


class Busy(Refused):
    pass


class ServerFault(Refused):
    pass


_BY_STATUS: dict[int, type[Refused]] = {
    400: BadRequest,
    401: Unauthenticated,
    403: Forbidden,
    404: NotFound,
    409: Conflict,
    413: TooLarge,
    422: Invalid,
    **dict.fromkeys((429, 502, 503, 504, 507), Busy),
}


def refusal(problem: Problem, *, retry_after_s: float | None = None) -> Refused:
    """The exception for an error answer, by its status."""
    return _BY_STATUS.get(problem.status, ServerFault)(problem, retry_after_s=retry_after_s)
