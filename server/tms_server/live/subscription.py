"""What a viewer asked for: query parameters, or else the first message."""

from __future__ import annotations

import asyncio
from typing import Any

from pydantic import ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from tms_schemas.live import Subscribe
from tms_server.errors import Invalid
from tms_server.problems import from_pydantic

#: Seconds a viewer has to say what it wants.
PATIENCE_S = 10.0
_MOST_CHARACTERS = 1_000_000
_LISTS = ("objects", "events")


async def subscription(websocket: WebSocket) -> Subscribe:
    """The subscription of an accepted connection. Raises ``Invalid``, or ``WebSocketDisconnect``."""
    try:
        if websocket.query_params:
            return Subscribe.model_validate(_from_query(websocket))
        return Subscribe.model_validate_json(await _first_message(websocket))
    except ValidationError as error:
        refused = from_pydantic(error)
        raise Invalid(f"subscription: {refused.detail}", items=refused.items) from error


def _from_query(websocket: WebSocket) -> dict[str, Any]:
    """Lists as repeated parameters or with commas."""
    given: dict[str, Any] = {}
    for name in websocket.query_params:
        values = websocket.query_params.getlist(name)
        if name in _LISTS:
            given[name] = [part for value in values for part in value.split(",") if part]
        elif len(values) > 1:
            raise Invalid(f"subscription: {name} is given more than once")
        else:
            given[name] = values[0]
    return given


async def _first_message(websocket: WebSocket) -> str:
    try:
        async with asyncio.timeout(PATIENCE_S):
            message = await websocket.receive()
    except TimeoutError:
        raise Invalid(f"no subscription came within {PATIENCE_S:g} s") from None
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code") or 1005)
    text = message.get("text")
    if text is None:
        raise Invalid("the subscription must be a text message")
    if len(text) > _MOST_CHARACTERS:
        raise Invalid("the subscription is too long")
    return str(text)
