"""What the README shows is what a reader gets: its commands and its program run against the demo."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text()
ADDRESS = "http://127.0.0.1:8080"

COMMANDS = sorted(
    (
        (command, output)
        for block in re.findall(r"```console\n(.*?)```", README, re.DOTALL)
        for command, output in re.findall(r"^\$ (.*?)\n(.*?)(?=^\$ |\Z)", block, re.DOTALL | re.MULTILINE)
    ),
    # Questions first: while another demo runs beside it for minutes, people in the room that is asked walk on.
    key=lambda item: item[0].startswith("tms demo"),
)
PROGRAMS = re.findall(r"```python\n(.*?)```\n\n```\n(.*?)```", README, re.DOTALL)


@pytest.fixture(scope="module")
def demo() -> Iterator[str]:
    """The demo after its story; its address."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tms_client", "demo", "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdout is not None
    told = ""
    for line in process.stdout:
        told += line
        if line.startswith("The room lives on"):
            break
    try:
        assert "The room lives on" in told, told
        yield "".join(re.findall(r"The page: (http://\S+?)/$", told, re.MULTILINE))
    finally:
        process.terminate()
        process.wait(30)
        process.stdout.close()


def run(arguments: list[str], url: str) -> str:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        arguments,
        env=os.environ | {"TMS_URL": url, "PATH": path},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


SHARE = re.compile(r"(\d+(?:\.\d)?) ?%")


def assert_like(expected: str, got: str) -> None:
    """The same words, where ``...`` stands for any; shares within three points of each other, and those under two may
    come and go: processes of their own made them out of noisy scans, and no two runs of those are the same."""
    expected, got = (" ".join(line for line in text.splitlines() if _counts(line)) for text in (expected, got))
    told = SHARE.split(" ".join(expected.split()))
    pattern = f"{SHARE.pattern}".join(re.escape(words).replace(r"\.\.\.", ".*?") for words in told[::2])
    found = re.fullmatch(pattern, " ".join(got.split()))
    assert found, f"the README says\n{expected}\nbut it is\n{got}"
    assert [float(one) for one in found.groups()] == pytest.approx([float(one) for one in told[1::2]], abs=3.0), got


def _counts(line: str) -> bool:
    share = SHARE.search(line)
    return share is None or float(share[1]) >= 2.0


def test_words_and_shares_are_compared() -> None:
    assert_like("a ... tea 95.6%\nmug 4%\n", "a\n  b c tea 97.4%\nmug 2 %\nno 1.4%\n")
    for other in ("a b coffee 95.6% mug 4%", "a b tea 91.9% mug 4%", "a b tea 95.6%"):
        with pytest.raises(AssertionError):
            assert_like("a ... tea 95.6% mug 4%", other)


def test_the_readme_has_snippets() -> None:
    assert len(COMMANDS) == 3
    assert len(PROGRAMS) == 1


@pytest.mark.timeout(600)
@pytest.mark.parametrize(("program", "output"), PROGRAMS, ids=["where"])
def test_programs(demo: str, program: str, output: str) -> None:
    assert ADDRESS in program
    assert_like(output, run([sys.executable, "-c", program.replace(ADDRESS, demo)], demo))


@pytest.mark.timeout(600)
@pytest.mark.parametrize(("command", "output"), COMMANDS, ids=[command for command, _ in COMMANDS])
def test_commands(demo: str, command: str, output: str) -> None:
    assert_like(output, run(["sh", "-c", command], demo))


def test_links_lead_somewhere() -> None:
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        for target in re.findall(r"\]\((?!http)([^)#]+)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"
