"""The hands of a robot that knows itself what it grasps: each call becomes observations, durable when it returns.

``Town.hand`` and ``AsyncTown.hand`` give one; ``grasping`` decides which events say what.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import json
import threading
import time
from collections.abc import Callable, Coroutine
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Concatenate, Literal, ParamSpec

from tms_client.api import Api
from tms_client.errors import NotFound, SpoolError, SpoolFull, TownError
from tms_client.flows import NO_RETRY, Flow
from tms_client.grasping import Gripper, Held, Onto, Table
from tms_client.posting import AsyncPoster, Poster
from tms_client.spool import Spool
from tms_schemas.base import Model, Xy
from tms_schemas.events import Covariance
from tms_schemas.observation import AgentState, Inventory, Observation
from tms_schemas.rooms import Room

#: Seconds at the end for what still waits in the spool; the rest stays there.
_DRAIN_S = 2.0
P = ParamSpec("P")
Verb = Callable[[Gripper, datetime], list[Observation]]


class Watched(Model):
    """What other agents' sensors see in the room: things put there are told by those."""

    furniture: frozenset[str] = frozenset()
    floor: bool = True

    @classmethod
    def of(cls, room: Room) -> Watched:
        return cls(
            furniture=frozenset(one.id for one in room.furniture if one.agent is not None),
            floor=any(sensor.kind == "floor" for sensor in room.sensors),
        )

    def sees(self, kind: Onto, surface: str | None) -> bool:
        if surface is not None:
            return surface.partition("/")[0] in self.furniture
        return self.floor if kind == "floor" else kind == "cabinet"


class Hands:
    """All hands of one agent over its spool. What they hold and put down changes on disk together with what is told.

    Safe to share between threads. Tells at once an ``inventory`` of what the agent's hands had when it ended.

    Raises:
        SpoolError: the spool holds notes that are none of ours.
        SpoolFull: too much waits already.
    """

    def __init__(self, spool: Spool, room: str, plan: Room | None, *, clock: Callable[[], float] = time.time) -> None:
        self.spool, self.room, self._clock = spool, room, clock
        self._own_spool = False
        self._lock = threading.RLock()
        self._table = Table()
        self._grippers: dict[str, Gripper] = {}
        known = spool.kept("watched")
        try:
            self._restore(json.loads(spool.kept("hands") or "{}"))
            stored = Watched() if known is None else Watched.model_validate_json(known)
        except ValueError as error:
            raise SpoolError(f"spool of {spool.agent}: what the hands held cannot be read: {error}") from error
        self._watched = stored if plan is None else Watched.of(plan)
        labels = {item.label: item for one in self._grippers.values() for item in one.labels()}
        last = self._table.last
        at = self.now() if last is None else max(last, self.now())
        self._table.last = at
        spool.put(
            room,
            Inventory(seq=0, observed_at=at, labels=list(labels.values())),
            AgentState(seq=0, observed_at=at, state="connected"),
            keep={"watched": self._watched.model_dump_json(), "hands": json.dumps(self._state())},
        )

    @classmethod
    def open(
        cls, spool: Spool | Path | str, agent: str, room: str, plan: Room | None, *, clock: Callable[[], float]
    ) -> Hands:
        """Over this spool, or over this file: then ``close`` closes it.

        Raises:
            SpoolError: the spool belongs to another agent, or is open elsewhere.
        """
        if isinstance(spool, Spool):
            if spool.agent != agent:
                raise SpoolError(f"the spool is that of agent {spool.agent!r}, not {agent!r}")
            return cls(spool, room, plan, clock=clock)
        own = Spool(spool, agent, clock=clock)
        try:
            hands = cls(own, room, plan, clock=clock)
        except BaseException:
            own.close()
            raise
        hands._own_spool = True
        return hands

    def close(self) -> None:
        if self._own_spool:
            self.spool.close()

    def now(self) -> datetime:
        return datetime.fromtimestamp(self._clock(), UTC)

    def held(self, hand: str) -> Held | None:
        with self._lock:
            return self._gripper(hand).held

    def act(self, hand: str, when: datetime | None, verb: Verb) -> None:
        """Post what ``verb`` says; where that fails, nothing has happened.

        Raises:
            ValueError: a tag, time or position that the wire cannot carry.
            SpoolFull: too much waits already.
        """
        with self._lock:
            gripper, before = self._gripper(hand), self._state()
            try:
                found = verb(gripper, self.now() if when is None else when)
                if found:
                    self.spool.put(self.room, *found, keep={"hands": json.dumps(self._state())})
            except BaseException:
                self._restore(before)
                raise

    def release(
        self,
        hand: str,
        when: datetime | None,
        xy: Xy,
        kind: Onto,
        surface: str | None,
        watched: bool | None,
        **more: Any,
    ) -> None:
        seen = self._watched.sees(kind, surface) if watched is None else watched
        self.act(hand, when, lambda g, at: g.released(at, xy, kind=kind, surface=surface, watched=seen, **more))

    def tell(self, state: Literal["connected", "silent"], why: str = "") -> None:
        """Post the state of the agent, unless the spool is full."""
        with contextlib.suppress(SpoolFull):
            self.spool.put(self.room, AgentState(seq=0, observed_at=self.now(), state=state, why=why))

    def _gripper(self, hand: str) -> Gripper:
        if hand not in self._grippers:
            self._grippers[hand] = Gripper(self.spool.new_label, table=self._table)
        return self._grippers[hand]

    def _state(self) -> dict[str, Any]:
        return {name: gripper.to_dict() for name, gripper in self._grippers.items()}

    def _restore(self, state: dict[str, Any]) -> None:
        self._table.things.clear()
        self._table.last = None
        for name in {*state, *self._grippers}:
            self._gripper(name).held = None
        for name, one in state.items():
            self._gripper(name).restore(one)


class Hand:
    """One hand. Positions are metres in the room frame, ``when`` is the time of the robot's own sensors (default: now).

    Calls return when the observations are on disk; the server need not be there. The same call again changes nothing.
    Each raises ``ValueError`` for what the wire cannot carry and ``SpoolFull`` where too much waits; nothing has
    happened then.
    """

    def __init__(self, hands: Hands, wake: Callable[[], object], name: str) -> None:
        self._hands, self._wake, self.name = hands, wake, name

    @property
    def held(self) -> Held | None:
        """What is in the hand."""
        return self._hands.held(self.name)

    def grasped(
        self,
        tag: str | None,
        xy: Xy,
        *,
        z: float | None = None,
        cov: Covariance | None = None,
        weight_g: float | None = None,
        when: datetime | None = None,
    ) -> None:
        """A thing was lifted. ``tag`` None: what it is was not read."""
        self._act(when, lambda g, at: g.grasped(at, xy, tag=tag, z=z, cov=cov, weight_g=weight_g))

    def read(self, tag: str, *, when: datetime | None = None) -> None:
        """The hand's reader reads the tag of what is held: later than the grasp, or once more."""
        self._act(when, lambda g, at: g.read(at, tag))

    def moved(
        self, xy: Xy, *, z: float | None = None, cov: Covariance | None = None, when: datetime | None = None
    ) -> None:
        """The hand is there now; call it as often as you like."""
        self._act(when, lambda g, at: g.moved(at, xy, z=z, cov=cov))

    def released(
        self,
        xy: Xy,
        *,
        surface: str | None = None,
        kind: Onto = "table",
        z: float | None = None,
        cov: Covariance | None = None,
        watched: bool | None = None,
        when: datetime | None = None,
    ) -> None:
        """The thing was put down at ``xy``: on ``surface`` (``furniture/surface``), or given to a person there.

        ``watched``: another agent's sensor sees it there and tells it. By default that is what the room says of the
        furniture; smart cabinets are watched, and the floor where the room has a floor sensor.
        """
        self._hands.release(self.name, when, xy, kind, surface, watched, z=z, cov=cov)
        self._wake()

    def lost(self, xy: Xy | None = None, *, when: datetime | None = None) -> None:
        """The thing fell out of the hand, or was taken; ``xy`` is where the hand was."""
        self._act(when, lambda g, at: g.dropped(at, xy))

    def _act(self, when: datetime | None, verb: Verb) -> None:
        self._hands.act(self.name, when, verb)
        self._wake()


def _in_a_thread(
    method: Callable[Concatenate[Hand, P], None],
) -> Callable[Concatenate[AsyncHand, P], Coroutine[Any, Any, None]]:
    """The same method to be awaited, with the same arguments."""

    async def awaited(self: AsyncHand, /, *args: P.args, **kwargs: P.kwargs) -> None:
        await asyncio.to_thread(method, self._hand, *args, **kwargs)

    functools.update_wrapper(awaited, method)
    return awaited


class AsyncHand:
    """``Hand`` for asyncio: the same methods, awaited; the disk is touched in worker threads only."""

    def __init__(self, hands: Hands, wake: Callable[[], object], name: str) -> None:
        loop = asyncio.get_running_loop()  # the poster belongs to it
        self._hand = Hand(hands, lambda: loop.call_soon_threadsafe(wake), name)
        self.name = name

    @property
    def held(self) -> Held | None:
        """What is in the hand."""
        return self._hand.held

    grasped = _in_a_thread(Hand.grasped)
    read = _in_a_thread(Hand.read)
    moved = _in_a_thread(Hand.moved)
    released = _in_a_thread(Hand.released)
    lost = _in_a_thread(Hand.lost)


class Running:
    """An agent whose hands are open: its spool, its poster in the background, its sign of life."""

    def __init__(self, hands: Hands, poster: Poster, *, heartbeat_s: float) -> None:
        self.hands, self.poster, self._heartbeat_s = hands, poster, heartbeat_s
        self.names: set[str] = set()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._beat, name=f"heartbeat of {hands.spool.agent}", daemon=True)
        poster.__enter__()
        self._thread.start()

    def close(self) -> None:
        """Tell the end, send what waits for a short time; the rest stays in the spool."""
        self._stop.set()
        self._thread.join()
        self.hands.tell("silent", "the agent ended")
        self.poster.wake()
        # Its thread sends; where the server is away there is nothing to wait for.
        until = time.monotonic() + _DRAIN_S
        while len(self.hands.spool) and self.poster.trouble is None and time.monotonic() < until:
            time.sleep(0.02)
        self.poster.__exit__()
        self.hands.close()

    def _beat(self) -> None:
        while not self._stop.wait(self._heartbeat_s):
            self.hands.tell("connected")
            self.poster.wake()


class AsyncRunning:
    """``Running`` for asyncio."""

    def __init__(self, hands: Hands, poster: AsyncPoster, *, heartbeat_s: float) -> None:
        self.hands, self.poster, self._heartbeat_s = hands, poster, heartbeat_s
        self.names: set[str] = set()

    async def start(self) -> None:
        await self.poster.__aenter__()
        self._task = asyncio.create_task(self._beat(), name=f"heartbeat of {self.hands.spool.agent}")

    async def aclose(self) -> None:
        """Tell the end, send what waits for a short time; the rest stays in the spool."""
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)
        await asyncio.to_thread(self.hands.tell, "silent", "the agent ended")
        await self.poster.drain(_DRAIN_S)
        await self.poster.__aexit__(None, None, None)
        self.hands.close()

    async def _beat(self) -> None:
        while True:
            await asyncio.sleep(self._heartbeat_s)
            await asyncio.to_thread(self.hands.tell, "connected")
            self.poster.wake()


def plan(room: str) -> Flow[Room | None]:
    """The room as the server has it, asked once; None where it cannot say: what the spool remembers will do then.

    Raises:
        NotFound: there is no such room.
    """
    try:
        return (yield from Api(NO_RETRY).room(room))
    except NotFound:
        raise
    except TownError:  # no server now, or no right to look
        return None


def only_one(agents: dict[str, Any], hand: str) -> Any:
    """The open agent that has a hand of this name. Raises ``TownError`` where there is none, or several."""
    having = [agent for agent in agents.values() if hand in agent.names]
    if len(having) != 1:
        trouble = f"no hand {hand!r} is open" if not having else f"several agents have a hand {hand!r}"
        raise TownError(f"{trouble}: town.hand(agent, room=..., spool=..., name={hand!r}) gives one, use that")
    return having[0]


def place(at: tuple[float, float] | tuple[float, float, float]) -> tuple[Xy, float | None]:
    """(x, y) or (x, y, z), metres, as position and height."""
    x, y, *rest = at
    return (x, y), rest[0] if rest else None
