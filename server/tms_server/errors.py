"""The error tree; every leaf carries its HTTP status and becomes ``application/problem+json``.

TmsError
├── NotFound                404
├── Conflict                409
├── Invalid                 422   (names the bad items)
├── BadRequest              400
├── TooLarge                413
├── Unauthenticated         401
├── Forbidden               403
├── TooManyRequests         429   (Retry-After)
└── Unavailable             503   (Retry-After)
"""

from __future__ import annotations

from typing import ClassVar

from tms_schemas.problem import Problem, ProblemItem


class TmsError(Exception):
    """Base; ``detail`` is one sentence for a person, ``items`` name the offending parts of the request."""

    status: ClassVar[int] = 500
    title: ClassVar[str] = "Internal error"

    def __init__(
        self, detail: str, *, items: list[ProblemItem] | None = None, retry_after_s: float | None = None
    ) -> None:
        super().__init__(detail)
        self.detail = detail
        self.items = items or []
        self.retry_after_s = retry_after_s

    def problem(self) -> Problem:
        return Problem(title=self.title, status=self.status, detail=self.detail, items=self.items)


class NotFound(TmsError):
    status, title = 404, "Not found"


class Conflict(TmsError):
    status, title = 409, "Conflict"


class Invalid(TmsError):
    status, title = 422, "Invalid"


class BadRequest(TmsError):
    status, title = 400, "Bad request"


class TooLarge(TmsError):
    status, title = 413, "Too large"


class Unauthenticated(TmsError):
    status, title = 401, "Not authenticated"


class Forbidden(TmsError):
    status, title = 403, "Forbidden"


class TooManyRequests(TmsError):
    status, title = 429, "Too many requests"


class Unavailable(TmsError):
    status, title = 503, "Unavailable"
