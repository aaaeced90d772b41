"""What the README shows is what a reader gets: its commands and its program run against the demo."""

from __future__ import annotations

import doctest
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
CHECKER = doctest.OutputChecker()

COMMANDS = [
    (command, output)
    for block in re.findall(r"```console\n(.*?)```", README, re.DOTALL)
    for command, output in re.findall(r"^\$ (.*?)\n(.*?)(?=^\$ |\Z)", block, re.DOTALL | re.MULTILINE)
]
PROGRAMS = re.findall(r"```python\n(.*?)```\n\n```\n(.*?)```", README, re.DOTALL)


@pytest.fixture(scope="module")
def demo() -> Iterator[str]:
    """The demo after its story; its address."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tms_client", "demo", "--speed", "5", "--port", "0"], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    url = ""
    for line in process.stdout:
        url = url or "".join(re.findall(r"The page: (http://\S+?)/$", line))
        if line.startswith("The room lives on"):
            break
    try:
        yield url
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
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


SHARE = re.compile(r"(\d+\.\d)%")


def assert_like(expected: str, got: str) -> None:
    """The same words; shares within a point of each other, and those under half a point may come and go: processes
    of their own made them, and no two runs of those are the same to the last digit."""
    told, shares = [], []
    for text in (expected, got):
        lines = [line for line in text.splitlines() if not (found := SHARE.search(line)) or float(found[1]) >= 0.5]
        told.append(SHARE.sub("%", "\n".join(lines)) + "\n")
        shares.append([float(one) for one in SHARE.findall("\n".join(lines))])
    same = CHECKER.check_output(told[0], told[1], doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert same, f"the README says\n{expected}\nbut it is\n{got}"
    assert shares[1] == pytest.approx(shares[0], abs=1.0), got


def test_the_readme_has_snippets() -> None:
    assert len(COMMANDS) == 3
    assert len(PROGRAMS) == 1


@pytest.mark.timeout(300)
@pytest.mark.parametrize(("command", "output"), COMMANDS, ids=[command for command, _ in COMMANDS])
def test_commands(demo: str, command: str, output: str) -> None:
    assert_like(output, run(["sh", "-c", command], demo))


@pytest.mark.timeout(300)
@pytest.mark.parametrize(("program", "output"), PROGRAMS, ids=["where"])
def test_programs(demo: str, program: str, output: str) -> None:
    assert ADDRESS in program
    assert_like(output, run([sys.executable, "-c", program.replace(ADDRESS, demo)], demo))


def test_links_lead_somewhere() -> None:
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        for target in re.findall(r"\]\((?!http)([^)#]+)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"
