"""The service's own addresses answer without keys, and errors are problems."""

import httpx


async def test_health_and_docs_answer(http: httpx.AsyncClient) -> None:
    assert (await http.get("/healthz")).json() == {"status": "ok"}
    assert (await http.get("/readyz")).status_code == 200
    docs = await http.get("/docs")
    assert "swagger-ui-bundle.js" in docs.text
    assert "//cdn" not in docs.text
    assert (await http.get("/docs/assets/swagger-ui-bundle.js")).status_code == 200


async def test_an_unknown_path_is_a_problem(http: httpx.AsyncClient) -> None:
    answer = await http.get("/nope")
    assert answer.status_code == 404
    assert answer.headers["content-type"].startswith("application/problem+json")
    assert answer.json()["status"] == 404
