"""The conversation with the server, without doing any input or output itself.

A *flow* is a generator: it yields a ``Call`` and is sent the response (or the transport error), yields a ``Wait`` and
is resumed after it, and returns a typed result. ``Town`` drives flows with blocking calls, ``AsyncTown`` with awaited
ones, so retries, error mapping and multi-step questions exist once.
"""

from __future__ import annotations

import email.utils
import random
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import httpx
from pydantic import BaseModel, ValidationError

from tms_client.errors import BadAnswer, Busy, TownError, Unreachable, refusal
from tms_schemas.problem import Problem

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True, slots=True)
class Call:
    """One HTTP request; ``path`` starts with ``/v1`` and is already quoted."""

    method: str
    path: str
    params: Mapping[str, str] = field(default_factory=dict)
    content: bytes | None = None
    content_type: str = "application/json"

    def request(self, client: httpx.Client | httpx.AsyncClient) -> httpx.Request:
        headers = {} if self.content is None else {"Content-Type": self.content_type}
        return client.build_request(
            self.method, self.path, params=dict(self.params) or None, content=self.content, headers=headers
        )


@dataclass(frozen=True, slots=True)
class Wait:
    seconds: float


Outcome = httpx.Response | httpx.HTTPError | None
Flow = Generator[Call | Wait, Outcome, T]


@dataclass(frozen=True, kw_only=True, slots=True)
class Retry:
    """Exponential backoff with jitter.

    The n-th pause is drawn uniformly from the upper half of ``min(cap_s, first_s * 2**n)``; a ``Retry-After`` of the
    server is waited out first. A call is given up after ``attempts`` tries, or when the next pause would exceed
    ``patience_s``.
    """

    attempts: int = 6
    first_s: float = 0.1
    cap_s: float = 10.0
    patience_s: float = 60.0
    random: random.Random = field(default_factory=random.Random)

    def pause(self, failures: int, retry_after_s: float | None = None) -> float:
        """Seconds to wait after ``failures`` >= 1 failures in a row."""
        step = min(self.cap_s, self.first_s * 2.0 ** min(failures - 1, 30))
        return (retry_after_s or 0.0) + step * self.random.uniform(0.5, 1.0)


#: One try, no pause: for callers that do their own waiting.
NO_RETRY = Retry(attempts=1)


def exchange(call: Call, parse: Callable[[httpx.Response], T], retry: Retry) -> Flow[T]:
    """Send ``call`` until it is answered.

    Raises:
        Unreachable, Busy: still so after the last attempt.
        Refused: any other error status, at once.
        BadAnswer: the answer cannot be read.
    """
    failures = 0
    while True:
        outcome = yield call
        if isinstance(outcome, httpx.Response) and outcome.is_success:
            return parse(outcome)
        error = _error(call, outcome)
        failures += 1
        if not isinstance(error, Unreachable | Busy) or failures >= retry.attempts:
            raise error
        pause = retry.pause(failures, error.retry_after_s if isinstance(error, Busy) else None)
        if pause > retry.patience_s:
            raise error
        yield Wait(pause)


M = TypeVar("M", bound=BaseModel)


def as_model(model: type[M]) -> Callable[[httpx.Response], M]:
    """Parser of a JSON answer. Fields this version does not know are ignored: the server may be newer."""

    def parse(response: httpx.Response) -> M:
        try:
            return model.model_validate_json(response.content, extra="ignore")
        except ValidationError as error:
            raise BadAnswer(f"{response.request.url}: {first_error(error)}") from error

    return parse


def nothing(_: httpx.Response) -> None:
    """Parser of an answer without a body."""


def _error(call: Call, outcome: Outcome) -> TownError:
    if isinstance(outcome, httpx.Response):
        return refusal(_problem(outcome), retry_after_s=_retry_after(outcome.headers))
    if isinstance(outcome, httpx.TransportError) and not isinstance(
        outcome, httpx.UnsupportedProtocol | httpx.LocalProtocolError
    ):
        url = outcome.request.url
        return Unreachable(f"{url.scheme}://{url.netloc.decode()} does not answer: {outcome or type(outcome).__name__}")
    return TownError(f"{call.method} {call.path}: {outcome!r}")


def _problem(response: httpx.Response) -> Problem:
    try:
        return Problem.model_validate({"title": response.reason_phrase, "status": 0, **response.json()}).model_copy(
            update={"status": response.status_code}
        )
    except (ValueError, TypeError):  # not JSON, not an object, not a problem: a proxy's page
        return Problem(title=response.reason_phrase, status=response.status_code)


def _retry_after(headers: httpx.Headers) -> float | None:
    """Seconds of ``Retry-After``: delta-seconds, or an HTTP date seen from the date of the answer itself."""
    value = headers.get("Retry-After", "")
    try:
        return max(0.0, float(value))
    except ValueError:
        pass
    try:
        at, sent = (email.utils.parsedate_to_datetime(text) for text in (value, headers.get("Date", "")))
        return max(0.0, (at - sent).total_seconds())
    except (ValueError, TypeError):  # no date, or only one of them with a time zone
        return None


def first_error(error: ValidationError) -> str:
    """Where and what, in one line."""
    one = error.errors(include_url=False)[0]
    return f"{'.'.join(str(part) for part in one['loc'])}: {one['msg']}"
