"""Schemathesis over the OpenAPI of a real server on each database: no 5xx, nothing undocumented."""

from __future__ import annotations

import contextlib
from pathlib import Path

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis.errors import Unsatisfiable
from schemathesis.checks import not_a_server_error
from schemathesis.generation import GenerationMode
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)
from server_process import ServerProcess

from tms_schemas.tiles import CELLS, Planes, pack, to_text

CHECKS = [not_a_server_error, status_code_conformance, content_type_conformance, response_schema_conformance]
ROOM = {"name": "contract", "outline": [[0, 0], [6, 0], [6, 5], [0, 5]]}


@pytest.mark.timeout(900)
@pytest.mark.parametrize("mode", [GenerationMode.POSITIVE, GenerationMode.NEGATIVE], ids=["valid", "invalid"])
def test_no_surprises(database_url: str, tmp_path: Path, mode: GenerationMode) -> None:
    """Valid and invalid requests, generated from the document that the server itself publishes."""
    with ServerProcess(tmp_path, database_url) as server:
        httpx.put(f"{server.url}/v1/rooms/0", json=ROOM).raise_for_status()
        httpx.put(f"{server.url}/v1/objects/0", json={"name": "tea", "room": "0"}).raise_for_status()
        httpx.put(f"{server.url}/v1/maps/0", json={"room": "0", "resolution": 0.05}).raise_for_status()
        tile = {"x": 0, "y": 0, "data": to_text(pack(Planes(bytes(CELLS))))}
        version = {"base": 0, "agent": "robot", "tiles": [tile]}
        httpx.post(f"{server.url}/v1/maps/0/versions", json=version).raise_for_status()
        schema = schemathesis.openapi.from_url(server.url + "/openapi.json")
        operations = [found.ok() for found in schema.get_all_operations()]
        assert len(operations) > 20
        for operation in operations:
            exercise(operation, mode)


def exercise(operation: schemathesis.APIOperation, mode: GenerationMode) -> None:
    @settings(max_examples=20, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
    @given(case=operation.as_strategy(generation_mode=mode))
    def check(case: schemathesis.Case) -> None:
        case.call_and_validate(checks=CHECKS)

    with contextlib.suppress(Unsatisfiable):  # an operation without parameters has no invalid request
        check()
