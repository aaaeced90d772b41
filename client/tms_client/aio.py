"""``AsyncTown``: ``Town`` for asyncio, the same methods awaited.

async with AsyncTown("http://town.local:8080", key="...") as town:
    print((await town.where("tea bottle")).best)
"""

from __future__ import annotations

import asyncio
import ssl
import time
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar

import httpx

from tms_client import lookup
from tms_client.answers import Location
from tms_client.api import Api, Area
from tms_client.connection import AsyncConnection, client_options
from tms_client.delivery import Pace
from tms_client.errors import TownError
from tms_client.flows import Flow, Retry
from tms_client.grasping import Onto
from tms_client.hands import AsyncHand, AsyncRunning, Hands, only_one, place, plan
from tms_client.live import Endpoint, LiveFrame, follow_async, subscription
from tms_client.maps.awaited import AsyncMap, AsyncMaps
from tms_client.posting import AsyncPoster
from tms_client.spool import Spool
from tms_schemas.agents import AgentView
from tms_schemas.belief import AnomaliesAnswer, LabelsAnswer, MoversAnswer, PlacementsAnswer
from tms_schemas.maps import Door, DoorState
from tms_schemas.objects import (
    CatalogueImport,
    IntakeResult,
    ObjectFields,
    ObjectModel,
    Product,
    ProductIn,
    TownObject,
    UnknownTag,
)
from tms_schemas.observation import BatchAccepted, ObservationBatch
from tms_schemas.rooms import Room, RoomIn

T = TypeVar("T")


class AsyncTown:
    """A connection to one server. Belongs to one event loop; use it as an async context manager.

    Every method raises ``TownError`` (see ``errors``): ``Unreachable`` and ``Busy`` only after the retries.
    """

    def __init__(
        self,
        url: str,
        key: str | None = None,
        *,
        timeout_s: float = 10.0,
        retry: Retry | None = None,
        verify: ssl.SSLContext | bool = True,
        transport: httpx.AsyncBaseTransport | None = None,
        sleep: Callable[[float], Awaitable[object]] = asyncio.sleep,
    ) -> None:
        self._retry = retry or Retry()
        self._http = httpx.AsyncClient(transport=transport, **client_options(url, key, timeout_s, verify))
        self._connection = AsyncConnection(self._http, sleep)
        self._api = Api(self._retry)
        self._endpoint = Endpoint(url, key, verify, timeout_s)
        self.objects = Objects(self._connection, self._api)
        self.products = Products(self._connection, self._api)
        self.rooms = Rooms(self._connection, self._api)
        self.agents = Agents(self._connection, self._api)
        self.maps = AsyncMaps(self._connection, self._api)
        self._agents: dict[str, AsyncRunning] = {}
        self._opening = asyncio.Lock()

    async def aclose(self) -> None:
        """Ends the hands that are open, then the connection."""
        async with self._opening:
            for running in self._agents.values():
                await running.aclose()
            self._agents.clear()
        await self._http.aclose()

    async def __aenter__(self) -> AsyncTown:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.aclose()

    async def where(self, name: str, *, at: datetime | None = None) -> Location:
        """Where the object with this tag, name or synonym probably is (now, or at ``at``).

        Raises:
            Ambiguous, NotFound: several objects fit equally well, or none; the message names the candidates.
        """
        return await self._run(lookup.where(self._api, name, at))

    async def map(self, name: str, *, version: int | None = None) -> AsyncMap:
        """A map as numpy arrays, the newest version by default; its ``update()`` fetches only what changed.

        Raises:
            NotFound: there is no such map or version.
            TownError: numpy is missing (it comes with the extra ``maps``).
        """
        return await self.maps.fetch(name, version)

    async def intake(
        self,
        tag: str,
        *,
        jan: str | None = None,
        name: str | None = None,
        room: str | None = None,
        synonyms: Sequence[str] = (),
    ) -> IntakeResult:
        """Register an object in one call: tag and JAN, an SGTIN-96 EPC alone, or tag and name."""
        return await self._run(self._api.intake(tag, jan=jan, name=name, room=room, synonyms=synonyms))

    async def unknown_tags(self, room: str | None = None) -> AsyncIterator[UnknownTag]:
        """Tags that were seen but are not registered."""
        cursor: str | None = None
        while True:
            page = await self._run(self._api.unknown_tags(room, cursor=cursor))
            for one in page.items:
                yield one
            if (cursor := page.next_cursor) is None:
                return

    async def placements(self, room: str, *, at: datetime | None = None) -> PlacementsAnswer:
        """All pies of a room."""
        return await self._run(self._api.placements(room, at))

    async def labels(self, room: str, *, at: datetime | None = None) -> LabelsAnswer:
        return await self._run(self._api.labels(room, at))

    async def movers(self, room: str, *, at: datetime | None = None) -> MoversAnswer:
        return await self._run(self._api.movers(room, at))

    async def anomalies(self, room: str, *, at: datetime | None = None) -> AnomaliesAnswer:
        return await self._run(self._api.anomalies(room, at))

    async def doors(self, room: str, *, state: DoorState | None = None) -> Sequence[Door]:
        """Which doors of a room are open, as robots saw them last; ``state`` leaves out all others."""
        return (await self._run(self._api.doors(room, state))).doors

    async def post(self, batch: ObservationBatch) -> BatchAccepted:
        """Post numbered observations at once, without a spool; returns when they are durable on the server."""
        return await self._run(self._api.post(batch))

    def poster(self, spool: Spool, room: str, *, pace: Pace | None = None, retry: Retry | None = None) -> AsyncPoster:
        """A poster that sends what the spool holds, through this connection."""
        return AsyncPoster(self._http, spool, room, pace=pace, retry=retry)

    async def hand(
        self,
        agent: str,
        *,
        room: str,
        spool: Spool | Path | str,
        name: str = "hand",
        heartbeat_s: float = 10.0,
        clock: Callable[[], float] = time.time,
    ) -> AsyncHand:
        """A hand of a robot that knows itself what it grasps; it works on while the server is away.

        Hands of the same agent (two arms) share its spool: a file that the agent owns. Open until the town is closed.

        Raises:
            NotFound: there is no such room.
            SpoolError: the spool belongs to another agent, or is open elsewhere.
        """
        async with self._opening:
            running = self._agents.get(agent)
            if running is None:
                running = self._agents[agent] = await self._open(agent, room, spool, heartbeat_s, clock)
            elif running.hands.room != room:
                raise TownError(f"agent {agent} works in room {running.hands.room!r}, not in {room!r}")
            running.names.add(name)
        return AsyncHand(running.hands, running.poster.wake, name)

    async def grasped(
        self,
        tag: str | None,
        at: tuple[float, float] | tuple[float, float, float],
        *,
        hand: str = "hand",
        weight_g: float | None = None,
        when: datetime | None = None,
    ) -> None:
        """Short for the ``grasped`` of the hand opened under this name; ``at`` is (x, y) or (x, y, z), metres."""
        xy, z = place(at)
        await self._hand(hand).grasped(tag, xy, z=z, weight_g=weight_g, when=when)

    async def released(
        self,
        at: tuple[float, float] | tuple[float, float, float],
        *,
        surface: str | None = None,
        kind: Onto = "table",
        hand: str = "hand",
        when: datetime | None = None,
    ) -> None:
        """Short for the ``released`` of the hand opened under this name; ``at`` is (x, y) or (x, y, z), metres."""
        xy, z = place(at)
        await self._hand(hand).released(xy, surface=surface, kind=kind, z=z, when=when)

    def live(
        self,
        room: str,
        *,
        objects: Sequence[str] = (),
        events: Sequence[str] = (),
        min_change: float = 0.0,
        with_events: bool = True,
        cursor: int | None = None,
    ) -> AsyncGenerator[LiveFrame, None]:
        """Snapshot, then events and states as they come; reconnects by itself and continues without loss."""
        wanted = subscription(
            room,
            self._retry,
            objects=objects,
            events=events,
            min_change=min_change,
            with_events=with_events,
            cursor=cursor,
        )
        return follow_async(self._endpoint, wanted)

    async def _open(
        self, agent: str, room: str, spool: Spool | Path | str, heartbeat_s: float, clock: Callable[[], float]
    ) -> AsyncRunning:
        hands = await asyncio.to_thread(Hands.open, spool, agent, room, await self._run(plan(room)), clock=clock)
        running = AsyncRunning(hands, self.poster(hands.spool, room), heartbeat_s=heartbeat_s)
        await running.start()
        return running

    def _hand(self, name: str) -> AsyncHand:
        running = only_one(self._agents, name)
        return AsyncHand(running.hands, running.poster.wake, name)

    async def _run(self, flow: Flow[T]) -> T:
        return await self._connection.run(flow)


class _Part:
    def __init__(self, connection: AsyncConnection, api: Api) -> None:
        self._connection, self._api = connection, api

    async def _run(self, flow: Flow[T]) -> T:
        return await self._connection.run(flow)


class Objects(_Part):
    """The object database."""

    async def get(self, tag: str) -> TownObject:
        return await self._run(self._api.get_object(tag))

    async def put(self, tag: str, fields: ObjectFields) -> TownObject:
        return await self._run(self._api.put_object(tag, fields))

    async def patch(self, tag: str, **changes: Any) -> TownObject:
        """Change the named fields; None clears one."""
        return await self._run(self._api.patch_object(tag, changes))

    async def delete(self, tag: str) -> None:
        await self._run(self._api.delete_object(tag))

    async def model(self, tag: str) -> ObjectModel:
        """Geometry for mapping."""
        return await self._run(self._api.object_model(tag))

    async def search(
        self,
        q: str | None = None,
        *,
        room: str | None = None,
        area: Area | None = None,
        category: str | None = None,
        limit: int | None = None,
    ) -> AsyncIterator[TownObject]:
        """All objects that fit, page by page (``limit`` per page): text, room, area (x0, y0, x1, y1 in metres)."""
        cursor: str | None = None
        while True:
            page = await self._run(
                self._api.objects(q=q, room=room, area=area, category=category, limit=limit, cursor=cursor)
            )
            for one in page.items:
                yield one
            if (cursor := page.next_cursor) is None:
                return


class Products(_Part):
    """The product catalogue, by JAN/EAN/GTIN."""

    async def get(self, jan: str) -> Product:
        return await self._run(self._api.product(jan))

    async def put(self, jan: str, product: ProductIn) -> Product:
        return await self._run(self._api.put_product(jan, product))

    async def import_csv(self, csv: str | bytes) -> CatalogueImport:
        """Import a catalogue; rows that cannot be taken are named in the answer."""
        return await self._run(self._api.import_catalogue(csv))


class Rooms(_Part):
    async def get(self, room: str) -> Room:
        return await self._run(self._api.room(room))

    async def put(self, room: str, fields: RoomIn) -> Room:
        return await self._run(self._api.put_room(room, fields))

    async def list(self) -> AsyncIterator[Room]:
        cursor: str | None = None
        while True:
            page = await self._run(self._api.rooms(cursor=cursor))
            for one in page.items:
                yield one
            if (cursor := page.next_cursor) is None:
                return


class Agents(_Part):
    async def get(self, agent: str) -> AgentView:
        return await self._run(self._api.agent(agent))

    async def list(self) -> AsyncIterator[AgentView]:
        """Who is alive, since when, how late."""
        cursor: str | None = None
        while True:
            page = await self._run(self._api.agents(cursor=cursor))
            for one in page.items:
                yield one
            if (cursor := page.next_cursor) is None:
                return
