"""Log in from the page, log out, and who one is."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from tms_schemas.keys import LoginRequest, WhoAmI
from tms_server.auth import COOKIE, Caller
from tms_server.errors import Unauthenticated
from tms_server.keys.ring import KeyRing
from tms_server.keys.scopes import Principal

router = APIRouter(tags=["keys"])


@router.post("/login")
async def login(body: LoginRequest, request: Request, response: Response) -> WhoAmI:
    """Exchange a key for the cookie that the page holds. 401 where the key is unknown or revoked."""
    keys: KeyRing = request.state.keys
    principal = await keys.find(body.key.strip())
    if principal is None:
        raise Unauthenticated("the key is unknown or revoked")
    # Out of reach of scripts, and never sent along with a request that another site started.
    response.set_cookie(
        COOKIE, body.key.strip(), httponly=True, samesite="strict", secure=request.url.scheme == "https", path="/"
    )
    return _who(principal)


@router.post("/logout", status_code=204)
async def logout(response: Response) -> None:
    """Forget the cookie. Always succeeds."""
    response.delete_cookie(COOKIE, httponly=True, samesite="strict", path="/")


@router.get("/me")
async def me(caller: Caller) -> WhoAmI:
    """Whose key this request carries, and what it allows."""
    return _who(caller)


def _who(principal: Principal) -> WhoAmI:
    return WhoAmI(key=principal.key, name=principal.name, scopes=sorted(principal.scopes))
