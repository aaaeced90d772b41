"""`tms catalogue import`: a file in parts, and the lines of the file in what it says."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from server_process import ServerProcess

from tms_client import Town, cli
from tms_client.commands import catalogue

cells = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\x00"), max_size=6)
rows = st.lists(st.tuples(cells, cells), max_size=12)


def written(table: list[tuple[str, ...]]) -> bytes:
    out = io.StringIO(newline="")
    csv.writer(out).writerows(table)
    return out.getvalue().encode()


def read(body: bytes) -> list[list[str]]:
    return list(csv.reader(io.StringIO(body.decode(), newline=""), strict=True))


@given(rows, st.integers(1, 60))
def test_the_parts_hold_every_row_once_in_order(table: list[tuple[str, str]], part_bytes: int) -> None:
    body = written([("jan", "name"), *table])
    parts = list(catalogue.split(body, part_bytes))
    assert all(read(part.body)[0] == ["jan", "name"] for part in parts)
    assert [row for part in parts for row in read(part.body)[1:]] == read(body)[1:]
    lines = list(io.StringIO(body.decode(), newline=""))
    for part in parts:
        if len(read(part.body)) > 1:
            first = list(io.StringIO(part.body.decode(), newline=""))[1]
            assert lines[1 + part.shift] == first


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    with ServerProcess(tmp_path_factory.mktemp("server")) as server:
        yield server


@pytest.mark.parametrize("encoding", ["utf-8-sig", "cp932"])
def test_a_catalogue_in_parts(
    server: ServerProcess,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    encoding: str,
) -> None:
    monkeypatch.setattr(catalogue, "PART_BYTES", 40)
    file = tmp_path / "products.csv"
    text = 'JANコード,商品名,メモ\n49968712,"ペン\n青",x\n4901234567890,bad digit,\n036000291452,ティッシュ,\n1,bad,\n'
    file.write_bytes(text.encode(encoding))
    assert cli.main(["catalogue", "import", str(file), "--url", server.url]) == 1
    out, err = capsys.readouterr()
    assert out == "2 products stored, 2 rows refused\n"
    assert [line.partition(":")[0] for line in err.splitlines()] == ["line 4", "line 6", "columns not imported"]
    with Town(server.url) as town:
        assert town.products.get("49968712").name == "ペン\n青"
        assert town.products.get("036000291452").name == "ティッシュ"


def test_bad_input_is_one_line_and_status_2(
    server: ServerProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "no.csv"
    file.write_text("a,b\n1,2\n")
    key = f"tms_00000000_{'0' * 64}"
    for arguments in (
        ["import", str(tmp_path / "missing.csv"), "--url", server.url],
        ["import", str(file), "--url", server.url],
        ["import", str(file), "--url", server.url, "--key", key],
        [],
    ):
        assert cli.main(["catalogue", *arguments]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
