"""The disk of the server becomes full while agents post: it says so, works on, and what it acknowledged is there."""

from __future__ import annotations

import resource
import threading
from pathlib import Path
from typing import Any

import httpx
from server_process import ServerProcess


def seen(seq: int) -> dict[str, Any]:
    at = f"2026-05-01T10:00:{seq:02d}Z"
    return {"seq": seq, "observed_at": at, "type": "label_appeared", "label": f"a/{seq}", "kind": "floor", "xy": [1, 2]}


def post(http: httpx.Client, *seqs: int) -> httpx.Response:
    body = {"agent": "a", "room": "lab", "observations": [seen(seq) for seq in seqs]}
    return http.post("/v1/observations", json=body)


def labels(http: httpx.Client) -> int:
    return len(http.get("/v1/rooms/lab/labels").json()["labels"])


def test_a_disk_that_becomes_full(tmp_path: Path) -> None:
    said: list[str] = []
    with ServerProcess(tmp_path) as server, httpx.Client(base_url=server.url, timeout=30) as http:
        listener = threading.Thread(target=lambda: said.extend(server.process.stderr or ()), daemon=True)
        listener.start()
        http.put("/v1/rooms/lab", json={"name": "Lab", "outline": [[0, 0], [8, 0], [8, 6]]})
        assert post(http, 0, 1).status_code == 200
        wal = (tmp_path / "tms.sqlite-wal").stat().st_size
        whole = resource.prlimit(server.process.pid, resource.RLIMIT_FSIZE, (wal, resource.RLIM_INFINITY))
        for seq in range(2, 30):
            refused = post(http, seq)
            assert refused.status_code == 503 and int(refused.headers["retry-after"]) >= 1
            assert refused.json()["detail"] == "the log cannot be written: disk I/O error"
        assert labels(http) == 2, "it answers all the same"
        resource.prlimit(server.process.pid, resource.RLIMIT_FSIZE, whole)
        assert post(http, *range(2, 30)).json()["accepted"] == 28
        server.kill()
        listener.join()
    assert len([line for line in said if "refused" in line]) == 2, "that it began, and that it is over"
    with ServerProcess(tmp_path) as server, httpx.Client(base_url=server.url, timeout=30) as http:
        assert labels(http) == 30
