"""Drives flows: blocking or awaited. The only place of this library where HTTP bytes move."""

from __future__ import annotations

import asyncio
import ssl
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import httpx

from tms_client.errors import TownError
from tms_client.flows import Call, Flow, Outcome, Wait

T = TypeVar("T")


def client_options(url: str, key: str | None, timeout_s: float, verify: ssl.SSLContext | bool) -> dict[str, Any]:
    """Arguments common to both kinds of httpx client.

    Raises:
        TownError: ``url`` is no http or https address.
    """
    try:
        if httpx.URL(url).scheme not in ("http", "https"):
            raise httpx.InvalidURL("it must begin with http:// or https://")
    except httpx.InvalidURL as error:
        raise TownError(f"the address {url!r} cannot be used: {error}") from error
    headers = {"Accept": "application/json"} | ({"Authorization": f"Bearer {key}"} if key else {})
    timeout = httpx.Timeout(timeout_s, connect=min(5.0, timeout_s))
    return {"base_url": url.rstrip("/"), "headers": headers, "timeout": timeout, "verify": verify}


class Connection:
    def __init__(self, http: httpx.Client, sleep: Callable[[float], object] = time.sleep) -> None:
        self.http = http
        self.sleep = sleep

    def run(self, flow: Flow[T]) -> T:
        outcome: Outcome = None
        while True:
            step = _advance(flow, outcome)
            if isinstance(step, _End):
                return step.value
            if isinstance(step, Wait):
                outcome = None
                self.sleep(step.seconds)
                continue
            try:
                outcome = self.http.send(step.request(self.http))
            except httpx.HTTPError as error:
                outcome = error


class AsyncConnection:
    """``threaded`` advances flows in worker threads: for those that touch a spool on disk."""

    def __init__(
        self,
        http: httpx.AsyncClient,
        sleep: Callable[[float], Awaitable[object]] = asyncio.sleep,
        *,
        threaded: bool = False,
    ) -> None:
        self.http = http
        self.sleep = sleep
        self._threaded = threaded

    async def run(self, flow: Flow[T]) -> T:
        outcome: Outcome = None
        while True:
            if self._threaded:
                step = await asyncio.to_thread(_advance, flow, outcome)
            else:
                step = _advance(flow, outcome)
            if isinstance(step, _End):
                return step.value
            if isinstance(step, Wait):
                outcome = None
                await self.sleep(step.seconds)
                continue
            try:
                outcome = await self.http.send(step.request(self.http))
            except httpx.HTTPError as error:
                outcome = error


@dataclass(frozen=True, slots=True)
class _End(Generic[T]):
    value: T


def _advance(flow: Flow[T], outcome: Outcome) -> Call | Wait | _End[T]:
    # StopIteration cannot cross a thread or a coroutine, hence a value of its own
    try:
        return flow.send(outcome)
    except StopIteration as end:
        return _End(end.value)
