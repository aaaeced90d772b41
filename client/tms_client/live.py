"""``WS /v1/live``: typed frames of one room, going on after a cut exactly where it was.

Event frames are numbered by the room log, so a reconnect that names the last one seen continues without a gap and
without repetition; then a snapshot is the new base of the states. State frames are latest-wins.
"""

from __future__ import annotations

import asyncio
import ssl
import time
from collections.abc import AsyncGenerator, Generator, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import TypeAdapter, ValidationError
from websockets.asyncio.client import connect as connect_async
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidMessage, InvalidStatus, InvalidURI
from websockets.sync.client import connect as connect_sync

from tms_client.errors import BadAnswer, Busy, TownError, Unreachable, refusal
from tms_client.flows import Retry
from tms_schemas.live import ErrorFrame, EventFrame, Frame, SnapshotFrame, StateFrame, Subscribe
from tms_schemas.problem import Problem

LiveFrame = SnapshotFrame | StateFrame | EventFrame
_FRAME: TypeAdapter[Frame] = TypeAdapter(Frame)
#: Close codes that trying again will not cure: policy (key missing, revoked, of another room), bad request.
_FINAL_CLOSE = {1003: 422, 1007: 422, 1008: 403, 4401: 401, 4403: 403, 4404: 404, 4422: 422}
_MAX_FRAME_BYTES = 64_000_000
_LOST = (OSError, TimeoutError, ConnectionClosed, InvalidHandshake, InvalidMessage)


@dataclass(frozen=True, slots=True)
class Endpoint:
    url: str
    key: str | None
    verify: ssl.SSLContext | bool
    timeout_s: float

    def options(self) -> dict[str, Any]:
        headers = {"Authorization": f"Bearer {self.key}"} if self.key else {}
        options: dict[str, Any] = {
            "additional_headers": headers,
            "open_timeout": self.timeout_s,
            "close_timeout": 1.0,
            "max_size": _MAX_FRAME_BYTES,
        }
        if self.address.startswith("wss:") and self.verify is not True:
            options["ssl"] = self.verify or ssl._create_unverified_context()
        return options

    @property
    def address(self) -> str:
        scheme, _, rest = self.url.rstrip("/").partition("://")
        return f"{'wss' if scheme == 'https' else 'ws'}://{rest}/v1/live"


class Subscription:
    """The protocol without input and output: what to ask for next, what a message means, how long to wait."""

    def __init__(self, subscribe: Subscribe, retry: Retry) -> None:
        self._subscribe = subscribe
        self._retry = retry
        self._cursor = subscribe.cursor
        self._failures = 0
        self._connected_once = False

    def request(self) -> str:
        """The first message of a connection."""
        return self._subscribe.model_copy(update={"cursor": self._cursor}).model_dump_json()

    def take(self, message: str | bytes) -> LiveFrame | None:
        """The frame of a message, or None for one to pass over (already seen, or of a later version).

        Raises:
            Refused: the server ends the subscription for good.
            BadAnswer: the message is no frame.
        """
        try:
            frame = _FRAME.validate_json(message, extra="ignore")
        except ValidationError as error:
            if any(one["type"] == "union_tag_invalid" for one in error.errors(include_url=False)):
                return None
            raise BadAnswer(f"/v1/live: {error.errors(include_url=False)[0]['msg']}") from error
        if isinstance(frame, ErrorFrame):
            raise refusal(Problem(title="Live view ended", status=frame.status, detail=frame.detail))
        self._failures, self._connected_once = 0, True
        if isinstance(frame, EventFrame):
            if self._cursor is not None and frame.cursor <= self._cursor:
                return None
            self._cursor = frame.cursor
        elif isinstance(frame, SnapshotFrame) or not self._subscribe.with_events:
            # A state may run ahead of events that are still under way: it moves the cursor only without events.
            self._cursor = frame.cursor
        return frame

    def lost(self, error: Exception) -> float:
        """The connection broke: seconds to wait before the next try.

        The first connection is given up after the attempts of ``retry``; one that worked is taken up again for ever.

        Raises:
            TownError: trying again is useless.
        """
        if isinstance(error, InvalidStatus):
            refused = refusal(Problem(title="Live view refused", status=error.response.status_code))
            if not isinstance(refused, Busy):
                raise refused from error
        if isinstance(error, ConnectionClosed) and error.rcvd is not None and error.rcvd.code in _FINAL_CLOSE:
            status = _FINAL_CLOSE[error.rcvd.code]
            raise refusal(Problem(title="Live view ended", status=status, detail=error.rcvd.reason)) from error
        self._failures += 1
        if not self._connected_once and self._failures >= self._retry.attempts:
            raise Unreachable(f"/v1/live: {error}") from error
        return self._retry.pause(self._failures, error.retry_after_s if isinstance(error, Busy) else None)


def subscription(
    room: str,
    retry: Retry,
    *,
    objects: Sequence[str],
    events: Sequence[str],
    min_change: float,
    with_events: bool,
    cursor: int | None,
) -> Subscription:
    wanted = Subscribe(
        room=room,
        objects=list(objects),
        events=list(events),
        min_change=min_change,
        with_events=with_events,
        cursor=cursor,
    )
    return Subscription(wanted, retry)


def follow(endpoint: Endpoint, subscription: Subscription) -> Generator[LiveFrame, None, None]:
    """Frames until the caller closes the generator."""
    while True:
        try:
            with connect_sync(endpoint.address, **endpoint.options()) as socket:
                socket.send(subscription.request())
                while True:
                    frame = subscription.take(socket.recv())
                    if frame is not None:
                        yield frame
        except (*_LOST, Busy) as error:
            time.sleep(subscription.lost(error))
        except InvalidURI as error:
            raise TownError(str(error)) from error


async def follow_async(endpoint: Endpoint, subscription: Subscription) -> AsyncGenerator[LiveFrame, None]:
    """Frames until the caller closes the generator (``contextlib.aclosing``)."""
    while True:
        try:
            async with connect_async(endpoint.address, **endpoint.options()) as socket:
                await socket.send(subscription.request())
                while True:
                    frame = subscription.take(await socket.recv())
                    if frame is not None:
                        yield frame
        except (*_LOST, Busy) as error:
            await asyncio.sleep(subscription.lost(error))
        except InvalidURI as error:
            raise TownError(str(error)) from error
