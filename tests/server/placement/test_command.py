"""``tms placement replay`` as a person calls it."""

import json
from pathlib import Path
from random import Random

import pytest

from tms_client.cli import main

from .worlds import WorldMaker


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "scenario.json"
    path.write_text(json.dumps(WorldMaker(Random(5), events=6).scenario))
    return path


@pytest.mark.parametrize("name", ["exact", "particle", "paper"])
@pytest.mark.parametrize("variant", ["full", "paper"])
def test_the_result_has_the_agreed_shape(scenario: Path, tmp_path: Path, name: str, variant: str) -> None:
    out = tmp_path / "out.json"
    argv = ["placement", "replay", str(scenario), "--filter", name, "--variant", variant, "--particles", "50"]
    assert main([*argv, "--seed", "4", "--out", str(out)]) == 0
    result = json.loads(out.read_text())
    assert {k: result[k] for k in ("scenario", "filter", "variant")} == {
        "scenario": "random", "filter": name, "variant": variant,
    }  # fmt: skip
    assert [s["event"] for s in result["steps"]] == list(range(-1, 6))
    for step in result["steps"]:
        assert set(step) == {"event", "marginals", "log_evidence", "contradiction", "seconds"}
        assert step["seconds"] >= 0


def test_bad_input_is_one_line_and_exit_2(scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "out.json")
    good = json.loads(scenario.read_text())
    broken = tmp_path / "broken.json"
    broken.write_text("{not json")
    invalid = tmp_path / "invalid.json"
    invalid.write_text(json.dumps({**good, "events": [{"type": "label_vanished", "label": "nowhere"}]}))
    unknown = tmp_path / "unknown.json"
    unknown.write_text(json.dumps({**good, "events": [{"type": "explosion"}]}))
    parameter = tmp_path / "parameter.json"
    parameter.write_text(json.dumps({**good, "params": {"p_jump": 7}}))
    for path, filter_, says in (
        (tmp_path / "missing.json", "exact", "missing.json"),
        (broken, "exact", "broken.json"),
        (invalid, "exact", "event 0"),
        (unknown, "exact", "events.0"),
        (parameter, "exact", "p_jump"),
        (scenario, "magic", "magic"),
        (scenario, "particle --particles 0", "particles"),
    ):
        argv = ["placement", "replay", str(path), "--filter", *filter_.split(), "--out", out]
        assert main(argv) == 2
        said = capsys.readouterr().err
        assert says in said
        assert len(said.strip().splitlines()) == 1
    assert not Path(out).exists()
