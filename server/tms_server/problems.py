"""Every error leaves as ``application/problem+json`` (RFC 9457), naming the bad parts of the request."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import Response

from tms_schemas.problem import Problem, ProblemItem
from tms_server.errors import BadRequest, Invalid, TmsError

_log = logging.getLogger(__name__)
MEDIA_TYPE = "application/problem+json"

#: What any route may answer besides its own; ``include_router(responses=...)`` documents it.
COMMON_RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {"description": HTTPStatus(status).phrase, "content": {MEDIA_TYPE: {"schema": Problem.model_json_schema()}}}
    for status in (400, 401, 403, 404, 409, 413, 422, 429, 503)
}


def install(app: FastAPI) -> None:
    """Register the handlers that turn exceptions into problems."""

    @app.exception_handler(TmsError)
    async def tms_error(_: Request, error: TmsError) -> Response:
        return response(error)

    @app.exception_handler(RequestValidationError)
    async def validation_error(_: Request, error: RequestValidationError) -> Response:
        return response(from_validation(error.errors()))

    @app.exception_handler(HTTPException)
    async def http_exception(_: Request, error: HTTPException) -> Response:
        problem = Problem(
            title=HTTPStatus(error.status_code).phrase, status=error.status_code, detail=str(error.detail)
        )
        return _answer(problem, dict(error.headers or {}))

    @app.exception_handler(ClientDisconnect)
    async def gone(_: Request, __: ClientDisconnect) -> Response:
        """In the middle of a body: nobody reads the answer, and it is no fault of the server."""
        return response(BadRequest("the body ended before its end"))

    @app.exception_handler(Exception)
    async def unexpected(request: Request, error: Exception) -> Response:
        _log.error("%s %s failed", request.method, request.url.path, exc_info=error)
        return _answer(Problem(title="Internal error", status=500, detail="the server's log says more"), {})


def response(error: TmsError) -> Response:
    headers = {}
    if error.retry_after_s is not None:
        headers["Retry-After"] = str(max(1, round(error.retry_after_s)))
    if error.status == HTTPStatus.UNAUTHORIZED:
        headers["WWW-Authenticate"] = "Bearer"
    return _answer(error.problem(), headers)


def from_validation(errors: Sequence[Any]) -> TmsError:
    """400 for what is no JSON at all, 422 naming each bad item otherwise."""
    if any(error["type"] == "json_invalid" for error in errors):
        detail = next(error for error in errors if error["type"] == "json_invalid")
        return BadRequest(f"the body is not JSON: {detail.get('ctx', {}).get('error', detail['msg'])}")
    items = [_item(error) for error in errors[:100]]
    return Invalid(f"{items[0].where}: {items[0].why}" if items else "invalid request", items=items)


def from_pydantic(error: ValidationError) -> TmsError:
    """The same for a body that an endpoint validated itself."""
    return from_validation(error.errors(include_url=False, include_context=True, include_input=False))


def _item(error: Any) -> ProblemItem:
    where = [part for part in error["loc"] if part not in ("body", "query", "path")]
    index = next((part for part in where if isinstance(part, int)), None) if where[:1] == ["observations"] else None
    return ProblemItem(where="/".join(str(part) for part in where) or "body", why=str(error["msg"]), index=index)


def _answer(problem: Problem, headers: dict[str, str]) -> Response:
    return Response(problem.model_dump_json(), problem.status, headers, MEDIA_TYPE)
