"""Agents as processes of their own, as on a sensor host."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from tms_agents.simulation.room import FLOOR_AGENT, MAPPER_AGENT, ROBOT_AGENT
from tms_agents.simulation.service import stop
from tms_client.cli import CommandError


class Agents:
    """Running agents by name; made by ``running_agents``."""

    def __init__(self, processes: Mapping[str, subprocess.Popen[bytes]], logs: Mapping[str, Path]) -> None:
        self._processes, self._logs = processes, logs

    def require_alive(self) -> None:
        """Raises CommandError naming an agent that ended, with its last words."""
        for name, process in self._processes.items():
            if process.poll() is not None:
                raise CommandError(f"agent {name} ended with status {process.returncode}: {self.last_words(name)}")

    def last_words(self, name: str) -> str:
        """The last line of an agent's log."""
        log = self._logs.get(name)
        lines = log.read_text(errors="replace").splitlines() if log is not None else []
        return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")

    def said(self, name: str, text: str) -> int:
        """How often an agent's log has it."""
        return self._logs[name].read_text(errors="replace").count(text)


def command(name: str, config: Path) -> list[str]:
    """How the agent is started, behind ``tms``."""
    kind = {ROBOT_AGENT: "hand", FLOOR_AGENT: "floor", MAPPER_AGENT: "robot"}.get(name, "cabinet")
    return ["agent", kind, "--config", str(config)]


@contextmanager
def running_agents(configs: Mapping[str, Path], url: str, key: str | None) -> Iterator[Agents]:
    """``tms agent`` for each configuration; their logs are beside the configurations."""
    environment = {name: value for name, value in os.environ.items() if name != "TMS_KEY"} | {"TMS_URL": url}
    if key is not None:
        environment["TMS_KEY"] = key
    processes: dict[str, subprocess.Popen[bytes]] = {}
    logs = {name: config.with_suffix(".log") for name, config in configs.items()}
    try:
        for name, config in configs.items():
            with logs[name].open("wb") as log:
                processes[name] = subprocess.Popen(
                    [sys.executable, "-m", "tms_client", *command(name, config)],
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=log,
                    env=environment,
                    start_new_session=True,  # Ctrl-C is ours to handle
                )
        yield Agents(processes, logs)
    finally:
        stop(*processes.values())
