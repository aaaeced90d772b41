"""``POST /v1/observations``."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import APIRouter, Request
from fastapi.routing import APIRoute
from starlette.responses import Response

from tms_schemas.observation import BatchAccepted, ObservationBatch
from tms_server.auth import authenticate, require_observe
from tms_server.errors import Conflict
from tms_server.ingest.admission import admit
from tms_server.town import Town


class _DirectRoute(APIRoute):
    """Hands the request to the endpoint as it is.

    What the framework does in between (dependencies, parsing to Python objects, exit stacks) costs more than validating
    and recording a small batch.
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        return self.endpoint


router = APIRouter(tags=["observations"], route_class=_DirectRoute)


def _inlined(schema: Any, definitions: dict[str, Any]) -> Any:
    """The schema with every reference replaced by what it refers to (no wire model is recursive)."""
    if isinstance(schema, list):
        return [_inlined(part, definitions) for part in schema]
    if not isinstance(schema, dict):
        return schema
    if "$ref" in schema:
        return _inlined(definitions[schema["$ref"].rpartition("/")[2]], definitions)
    return {k: _inlined(v, definitions) for k, v in schema.items() if k not in ("$defs", "discriminator")}


def _request_body() -> dict[str, Any]:
    schema = ObservationBatch.model_json_schema()
    return {"required": True, "content": {"application/json": {"schema": _inlined(schema, schema["$defs"])}}}


@router.post("/observations", response_model=BatchAccepted, openapi_extra={"requestBody": _request_body()})
async def post_observations(request: Request) -> Response:
    """Record a batch of one agent in one room, whole or not at all; answered once it is durable.

    The same (agent, seq) with the same body again counts as a duplicate; with another body it is a conflict (409)
    and nothing of the batch is recorded. 429 and 503 say when to send the same batch again.
    """
    caller = await authenticate(request)
    batch = admit(await request.body())
    require_observe(caller, batch.room)
    town: Town = request.state.town
    try:
        done = await town.writer.submit(batch)
    except Conflict as refused:
        request.state.disputes.note(batch.agent, refused.detail, request.state.clock.now())
        raise
    answer = BatchAccepted(accepted=done.accepted, duplicates=done.duplicates, head=done.head, too_late=done.too_late)
    return Response(answer.model_dump_json(), media_type="application/json")
