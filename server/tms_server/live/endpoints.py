"""``WS /v1/live``: accept, check, serve one viewer until it or its right to see ends."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Coroutine
from typing import Any

from fastapi import APIRouter, WebSocket
from starlette.websockets import WebSocketDisconnect

from tms_server.auth import authenticate, require_read
from tms_server.errors import TmsError, Unavailable
from tms_server.live.feed import Feeds
from tms_server.live.frames import close_code, error_frame
from tms_server.live.subscription import subscription
from tms_server.live.viewer import TooSlow, Viewer

router = APIRouter()
_log = logging.getLogger(__name__)
#: Seconds between two looks whether the viewer's key still holds.
CHECK_S = 2.0
#: Seconds that a closing handshake may take.
_CLOSE_S = 2.0


@router.websocket("/live")
async def live(websocket: WebSocket) -> None:
    """Frames of one room (see ``tms_schemas.live``); an error frame and a close code 4000 + status where refused."""
    await websocket.accept()
    try:
        await _serve(websocket)
    except (WebSocketDisconnect, ConnectionError):
        return
    except TmsError as error:
        await _end(websocket, error)
    except Exception:
        _log.exception("a live view failed")
        await _end(websocket, Unavailable("the live view failed; come again", retry_after_s=1))


async def _serve(websocket: WebSocket) -> None:
    caller = await authenticate(websocket)
    wanted = await subscription(websocket)
    require_read(caller, wanted.room)
    feeds: Feeds = websocket.state.feeds
    async with feeds.watch(wanted.room) as feed:
        viewer = Viewer(feed, wanted, websocket.send_text)
        await _first_to_end(viewer.run(), _left(websocket), _checked(websocket, wanted.room))


async def _first_to_end(*parts: Coroutine[Any, Any, None]) -> None:
    """Run the parts side by side; when one ends, so do the others, and what it raised is raised."""
    tasks = [asyncio.ensure_future(part) for part in parts]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in done:
        task.result()


async def _left(websocket: WebSocket) -> None:
    """Until the viewer goes; what it says meanwhile means nothing."""
    while (await websocket.receive())["type"] != "websocket.disconnect":
        pass


async def _checked(websocket: WebSocket, room: str) -> None:
    """Until the viewer's key is revoked or its scopes are taken away: raises then."""
    while True:
        await asyncio.sleep(CHECK_S)
        require_read(await authenticate(websocket), room)


async def _end(websocket: WebSocket, error: TmsError) -> None:
    """Say why and close. A connection that does not drain is left to the server, which drops it."""
    with contextlib.suppress(TimeoutError, RuntimeError, WebSocketDisconnect, ConnectionError):
        async with asyncio.timeout(_CLOSE_S):
            if not isinstance(error, TooSlow):
                await websocket.send_text(error_frame(error))
            await websocket.close(close_code(error), _short(error.detail))


def _short(reason: str) -> str:
    """At most 123 bytes, as a close frame allows."""
    return reason.encode()[:120].decode(errors="ignore")
