"""Posters: take observations into the spool at once, send them in the background."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from types import TracebackType

import httpx

from tms_client.connection import AsyncConnection, Connection
from tms_client.delivery import Delivery, Pace
from tms_client.errors import TownError
from tms_client.flows import Retry
from tms_client.spool import Spool
from tms_schemas.observation import Observation


class Poster:
    """Posts the observations of one agent from a thread; use as a context manager, or ``drain`` by hand."""

    def __init__(
        self, http: httpx.Client, spool: Spool, room: str, *, pace: Pace | None = None, retry: Retry | None = None
    ) -> None:
        self.spool, self.room = spool, room
        self._pace = pace or Pace()
        self._delivery = Delivery(spool, self._pace, retry or Retry(cap_s=30.0))
        self._stop, self._wake = threading.Event(), threading.Event()
        self._connection = Connection(http, self._stop.wait)
        self._one_at_a_time = threading.Lock()
        self._thread: threading.Thread | None = None

    @property
    def trouble(self) -> TownError | None:
        """Why posting fails at present; None while it works."""
        return self._delivery.trouble

    def post(self, *observations: Observation) -> None:
        """Take observations durably (their ``seq`` is replaced); they are sent as soon as the server takes them.

        Raises:
            SpoolFull: too much waits already.
        """
        self.spool.put(self.room, *observations)
        self._wake.set()

    def wake(self) -> None:
        """Something was put into the spool: send it now."""
        self._wake.set()

    def drain(self, timeout_s: float = 30.0) -> bool:
        """Send until nothing waits; False where that took too long."""
        deadline = time.monotonic() + timeout_s

        def pause(seconds: float) -> None:
            self._stop.wait(max(0.0, min(seconds, deadline - time.monotonic())))

        if not self._one_at_a_time.acquire(timeout=timeout_s):
            return False  # the thread is at it all the time, in vain
        try:
            flow = self._delivery.drain(lambda: time.monotonic() < deadline)
            return Connection(self._connection.http, pause).run(flow)
        finally:
            self._one_at_a_time.release()

    def __enter__(self) -> Poster:
        self._thread = threading.Thread(target=self._run, name=f"poster of {self.spool.agent}", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop; what is not acknowledged stays in the spool."""
        self._stop.set()
        self._wake.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        while not self._stop.is_set():
            with self._one_at_a_time:
                self._connection.run(self._delivery.drain(lambda: not self._stop.is_set()))
            sent_at = time.monotonic()
            self._wake.wait()
            self._wake.clear()
            if len(self.spool) < self._pace.batch:
                self._stop.wait(max(0.0, self._pace.linger_s - (time.monotonic() - sent_at)))


class AsyncPoster:
    """The same for asyncio: posts from a task; the disk is touched in worker threads only."""

    def __init__(
        self,
        http: httpx.AsyncClient,
        spool: Spool,
        room: str,
        *,
        pace: Pace | None = None,
        retry: Retry | None = None,
    ) -> None:
        self.spool, self.room = spool, room
        self._pace = pace or Pace()
        self._delivery = Delivery(spool, self._pace, retry or Retry(cap_s=30.0))
        self._connection = AsyncConnection(http, threaded=True)
        self._wake = asyncio.Event()
        self._in_order, self._one_at_a_time = asyncio.Lock(), asyncio.Lock()
        self._task: asyncio.Task[None] | None = None

    @property
    def trouble(self) -> TownError | None:
        """Why posting fails at present; None while it works."""
        return self._delivery.trouble

    async def post(self, *observations: Observation) -> None:
        """Take observations durably (their ``seq`` is replaced); they are sent as soon as the server takes them.

        Raises:
            SpoolFull: too much waits already.
        """
        async with self._in_order:
            await asyncio.to_thread(self.spool.put, self.room, *observations)
        self._wake.set()

    def wake(self) -> None:
        """Something was put into the spool: send it now."""
        self._wake.set()

    async def drain(self, timeout_s: float = 30.0) -> bool:
        """Send until nothing waits; False where that took too long."""
        try:
            async with asyncio.timeout(timeout_s), self._one_at_a_time:
                return await self._connection.run(self._delivery.drain(lambda: True))
        except TimeoutError:
            return False

    async def __aenter__(self) -> AsyncPoster:
        self._task = asyncio.create_task(self._run(), name=f"poster of {self.spool.agent}")
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop; what is not acknowledged stays in the spool."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task

    async def _run(self) -> None:
        while True:
            async with self._one_at_a_time:
                await self._connection.run(self._delivery.drain(lambda: True))
            sent_at = time.monotonic()
            await self._wake.wait()
            self._wake.clear()
            if len(self.spool) < self._pace.batch:
                await asyncio.sleep(max(0.0, self._pace.linger_s - (time.monotonic() - sent_at)))
