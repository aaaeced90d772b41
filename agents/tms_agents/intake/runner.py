"""``tms intake`` at work: inputs in, one session, until the keyboard ends or somebody stops it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator

from tms_agents.devices.transport import DeviceState
from tms_agents.intake.config import IntakeConfig
from tms_agents.intake.inputs import (
    Device,
    End,
    Input,
    Line,
    Queue,
    Read,
    Scanned,
    Tick,
    inputs,
    keyboard,
    reader,
    scanner,
)
from tms_agents.intake.pairing import Pairing
from tms_agents.intake.session import Said, Session, Tally
from tms_client import AsyncTown, Retry

_RETRY = Retry(attempts=4, patience_s=5.0)


async def run(config: IntakeConfig, say: Said, *, fd: int | None, can_ask: bool) -> Tally:
    """Take things in until cancelled; without devices, until the keyboard (``fd``) is at its end.

    Raises:
        CommandError: a capture instead of a reader cannot be read.
        TownError: the address of the server is none.
    """
    sources: list[AsyncGenerator[Input, None]] = [] if fd is None else [keyboard(fd)]
    if config.reader is not None:
        sources.append(reader(config.reader, config.silent_after_s))
    if config.scanner is not None:
        sources.append(scanner(config.scanner))
    devices = config.reader is not None or config.scanner is not None
    pairing = Pairing(expires_s=config.expires_s, settle_s=config.settle_s, gone_s=config.gone_s)
    async with AsyncTown(config.server.url, config.server.key, retry=_RETRY) as town:
        session = Session(town, pairing, say, room=config.room, can_ask=can_ask)
        try:
            async with inputs(*sources) as queue:
                await _work(session, queue, say, stops_at_end=not devices)
        except asyncio.CancelledError:
            if session.sending is not None:
                say.bad(f"Tag {session.sending} was on its way to the server: do it again, that does no harm.")
        return session.tally


async def once(config: IntakeConfig, say: Said, *, tag: str, code: str | None, name: str | None) -> bool:
    """Register one thing whose tag and barcode are known; False, and said why, where that did not work."""
    async with AsyncTown(config.server.url, config.server.key, retry=_RETRY) as town:
        session = Session(town, Pairing(), say, room=config.room, can_ask=False)
        return await session.register(tag, code, name)


async def _work(session: Session, queue: Queue, say: Said, *, stops_at_end: bool) -> None:
    while True:
        t, one = await queue.get()
        match one:
            case Line(text):
                await session.line(t, text)
            case Scanned(code):
                await session.scan(t, code)
            case Read(tag):
                await session.read(t, tag)
            case Tick():
                await session.tick(t)
            case Device(name, state):
                _device(name, state, say)
            case End():
                if stops_at_end:
                    return


def _device(name: str, state: DeviceState, say: Said) -> None:
    match state.state:
        case "connected":
            say.good(f"The {name} is ready.")
        case "silent":
            say.bad(f"The {name} says nothing: is it switched on? ({state.why})")
        case "faulty":
            say.bad(f"The {name} is not connected. ({state.why})")
