"""The example of a robot program, run as its reader would run it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from server_process import ServerProcess

from tms_agents.simulation.demo import Plan, register
from tms_agents.simulation.stage import staged
from tms_agents.simulation.story import STEPS, furnish
from tms_client import Town

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "fetch_and_carry.py"


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A town in the middle of the story: the tea bottle is on the floor or with the person, evens."""
    folder = tmp_path_factory.mktemp("fetch")
    with ServerProcess(folder) as server, Town(server.url) as town:
        register(town, Plan())
        with staged(town, server.url, None, "demo", folder, seed=0, speed=20.0) as (_, player):
            player.play(furnish(player.world))
            for step in STEPS[:4]:
                player.play(step.act(player.world))
        yield server.url


def example(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, str(EXAMPLE), *arguments], capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize("truth", ["on the floor", "with the person"])
def test_it_tries_the_next_place_where_the_first_is_empty(url: str, truth: str) -> None:
    done = example("--url", url, "--really-at", truth)
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[0].startswith("Tea bottle (E0040150")
    assert "2 place(s) worth a look" in lines[0]
    places = [line.split(". ")[1].split(" [")[0] for line in lines[1:3]]
    assert sorted(places) == ["on the floor", "with the person"]
    looks = lines[3:]
    assert len(looks) == places.index(truth) + 1
    assert all("not there" in line for line in looks[:-1])
    assert truth in looks[-1] and ": found" in looks[-1]


def test_a_thing_that_is_nowhere_near_is_not_found(url: str) -> None:
    assert example("--url", url, "--really-at", "on the moon").stdout.splitlines()[-1] == "not found; asking a person"


def test_what_is_unknown_is_said(url: str) -> None:
    done = example("--url", url, "unicorn")
    assert done.returncode == 2
    assert "no object is called 'unicorn'" in done.stdout
