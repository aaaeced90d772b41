"""Liveness and readiness. ``/healthz`` says the process answers; ``/readyz`` that it can serve."""

from __future__ import annotations

from fastapi import APIRouter, Request
from pydantic import BaseModel
from sqlalchemy import text

from tms_schemas.problem import Problem
from tms_server.db.session import Sessions
from tms_server.errors import Unavailable

router = APIRouter(tags=["health"])


class Health(BaseModel):
    status: str


@router.get("/healthz")
async def healthz() -> Health:
    return Health(status="ok")


@router.get("/readyz", responses={503: {"model": Problem}})
async def readyz(request: Request) -> Health:
    sessions: Sessions = request.state.sessions
    try:
        async with sessions.read() as session:
            await session.execute(text("select 1"))
    except Exception as error:
        raise Unavailable(f"the database does not answer: {type(error).__name__}", retry_after_s=5) from error
    return Health(status="ready")
