"""Schemathesis over the OpenAPI of a real server on each database: no 5xx, nothing undocumented."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, settings
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)
from server_process import ServerProcess

CHECKS = [not_a_server_error, status_code_conformance, content_type_conformance, response_schema_conformance]
ROOM = {"name": "contract", "outline": [[0, 0], [6, 0], [6, 5], [0, 5]]}


def served(tmp: Path, database_url: str | None) -> Iterator[schemathesis.schemas.BaseSchema]:
    with ServerProcess(tmp, database_url) as server:
        httpx.put(f"{server.url}/v1/rooms/0", json=ROOM).raise_for_status()
        httpx.put(f"{server.url}/v1/objects/0", json={"name": "tea", "room": "0"}).raise_for_status()
        yield schemathesis.openapi.from_url(server.url + "/openapi.json")


@pytest.fixture(scope="module")
def on_sqlite(tmp_path_factory: pytest.TempPathFactory) -> Iterator[schemathesis.schemas.BaseSchema]:
    yield from served(tmp_path_factory.mktemp("sqlite"), None)


@pytest.fixture(scope="module")
def on_postgresql(
    tmp_path_factory: pytest.TempPathFactory, module_postgres_url: str
) -> Iterator[schemathesis.schemas.BaseSchema]:
    yield from served(tmp_path_factory.mktemp("postgresql"), module_postgres_url)


sqlite_schema = schemathesis.pytest.from_fixture("on_sqlite")
postgres_schema = schemathesis.pytest.from_fixture("on_postgresql")
LIMITS = settings(
    max_examples=30, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck), database=None
)


@pytest.mark.timeout(600)
@sqlite_schema.parametrize()
@LIMITS
def test_no_surprises_on_sqlite(case: schemathesis.Case) -> None:
    case.call_and_validate(checks=CHECKS)


@pytest.mark.timeout(600)
@postgres_schema.parametrize()
@LIMITS
def test_no_surprises_on_postgresql(case: schemathesis.Case) -> None:
    case.call_and_validate(checks=CHECKS)
