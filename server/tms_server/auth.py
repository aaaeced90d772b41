"""Who is asking and what they may do, the same for HTTP and WebSocket.

A key comes as ``Authorization: Bearer tms_...`` or in the cookie that the page got from ``POST /v1/login``. While no
key was ever made, a caller on loopback is the administrator: the peer and the address it called must both be
loopback, and nothing may say that a proxy stands between. Endpoints take one of the annotated types::

    async def answer(room: RoomId, caller: Caller) -> ...:      # any valid key
        require_read(caller, room)                              # 403 for a key of another room

    async def answer(room: RoomId, caller: RoomReader) -> ...:  # the path parameter ``room`` is checked already
"""

from __future__ import annotations

import ipaddress
from functools import lru_cache
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import Depends
from sqlalchemy import inspect
from starlette.requests import HTTPConnection

from tms_schemas.base import RoomId
from tms_server.db.engine import create_engine
from tms_server.db.session import Sessions
from tms_server.errors import Forbidden, Unauthenticated
from tms_server.keys.repository import KeyRepository
from tms_server.keys.ring import KeyRing
from tms_server.keys.scopes import ADMIN, Principal
from tms_server.settings import Settings

COOKIE = "tms_key"
_LOCAL = Principal(key=None, name="loopback", scopes=frozenset({ADMIN}))
_HOW = "send a key as 'Authorization: Bearer tms_...'; make one with: tms keys create NAME --scope SCOPE"


async def authenticate(connection: HTTPConnection) -> Principal:
    """Whose request this is. Raises ``Unauthenticated``."""
    keys: KeyRing = connection.state.keys
    bearer = bearer_text(connection)
    if bearer is not None:
        return _known(await keys.find(bearer))
    if not _same_origin(connection):
        # A foreign page in somebody's browser must not use that browser's cookie or its place on this machine.
        raise Unauthenticated("a page of another origin needs a key in the Authorization header")
    if await keys.is_empty():
        if is_local(connection):
            return _LOCAL
        raise Unauthenticated(f"this server has no keys and answers only on loopback, without a proxy; {_HOW}")
    cookie = connection.cookies.get(COOKIE)
    if cookie is None:
        raise Unauthenticated(f"a key is needed; {_HOW}")
    return _known(await keys.find(cookie))


Caller = Annotated[Principal, Depends(authenticate)]


async def _admin(caller: Caller) -> Principal:
    return require_admin(caller)


async def _room_reader(room: RoomId, caller: Caller) -> Principal:
    return require_read(caller, room)


async def _room_observer(room: RoomId, caller: Caller) -> Principal:
    return require_observe(caller, room)


#: Only ``admin``.
Admin = Annotated[Principal, Depends(_admin)]
#: ``read:<room>`` or ``admin``, for the path parameter ``room``.
RoomReader = Annotated[Principal, Depends(_room_reader)]
#: ``observe:<room>`` or ``admin``, for the path parameter ``room``.
RoomObserver = Annotated[Principal, Depends(_room_observer)]


def require_admin(caller: Principal) -> Principal:
    if not caller.is_admin:
        raise Forbidden(f"key {caller.name!r} lacks the scope admin")
    return caller


def require_read(caller: Principal, room: str) -> Principal:
    if not caller.may_read(room):
        raise Forbidden(f"key {caller.name!r} lacks the scope read:{room}")
    return caller


def require_observe(caller: Principal, room: str) -> Principal:
    if not caller.may_observe(room):
        raise Forbidden(f"key {caller.name!r} lacks the scope observe:{room}")
    return caller


def require_see(caller: Principal, room: str | None) -> Principal:
    """Master data of a room: for keys that may read it or observe in it."""
    if not caller.may_see(room):
        raise Forbidden(f"key {caller.name!r} lacks the scope read:{room}")
    return caller


def bearer_text(connection: HTTPConnection) -> str | None:
    """The text of the Authorization header, None where there is none. Raises ``Unauthenticated`` for another scheme."""
    header = connection.headers.get("authorization")
    if header is None:
        return None
    scheme, _, text = header.partition(" ")
    if scheme.lower() != "bearer":
        raise Unauthenticated(f"the Authorization header must be of the scheme Bearer; {_HOW}")
    return text.strip()


def is_local(connection: HTTPConnection) -> bool:
    """True where the peer and the address it called are loopback and no proxy header is present.

    The Host header counts as well as the socket's address: a foreign name that resolves to 127.0.0.1 (DNS rebinding)
    is no local call.
    """
    names = connection.headers.keys()
    if any(name == "forwarded" or name.startswith("x-forwarded-") for name in names):
        return False
    server = connection.scope.get("server")
    peer = connection.client
    hosts = connection.headers.getlist("host")
    return (
        peer is not None
        and _is_loopback(peer.host)
        and server is not None
        and _is_loopback(server[0])
        and len(hosts) == 1
        and _is_loopback(_hostname(f"//{hosts[0]}"))
    )


async def any_keys(settings: Settings) -> bool:
    """True where the database holds a key that is not revoked; False also where there is no database yet."""
    engine = create_engine(settings.url())
    try:
        async with engine.connect() as connection:
            if not await connection.run_sync(lambda sync: inspect(sync).has_table("api_keys")):
                return False
        async with Sessions(engine).read() as session:
            return any(row.revoked_at is None for row in await KeyRepository(session).all())
    finally:
        await engine.dispose()


def _known(principal: Principal | None) -> Principal:
    if principal is None:
        raise Unauthenticated("the key is unknown or revoked")
    return principal


def _same_origin(connection: HTTPConnection) -> bool:
    """Browsers name the origin of a page in WebSocket handshakes and in every call that may change something."""
    origin = connection.headers.get("origin")
    if origin is None:
        return True
    called = connection.headers.get("host", "").lower()
    return called != "" and origin.lower() in (f"http://{called}", f"https://{called}")


@lru_cache(maxsize=1024)
def _hostname(url: str) -> str | None:
    try:
        return urlsplit(url).hostname
    except ValueError:
        return None


@lru_cache(maxsize=1024)  # every request asks it three times, of the same few
def _is_loopback(host: str | None) -> bool:
    if host is None:
        return False
    if host == "localhost":
        return True
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return False
    mapped = getattr(address, "ipv4_mapped", None)
    return (mapped or address).is_loopback
