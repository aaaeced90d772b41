"""The demo's map: the robot's drive goes through `tms slam run` in a process beside the story, then to the server."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from tms_agents.simulation.room import ROBOT_AGENT
from tms_agents.simulation.service import stop
from tms_client import Town, TownError
from tms_schemas.maps import MapIn

#: The mapper works beside the agents, not before them.
_NICE = 10


class RoomMap:
    """``poll`` now and then; made by ``mapping``."""

    def __init__(self, town: Town, room: str, out: Path, process: subprocess.Popen[bytes]) -> None:
        self._town, self._room, self._out, self._process = town, room, out, process
        self._done = False

    def poll(self, say: Callable[[str], None], patience_s: float = 0.0) -> None:
        """The map goes to the server once it is made; waits so long for it at most."""
        if self._done:
            return
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(patience_s or 0.01)
        if self._process.poll() is None:
            if patience_s:
                say("The robot's map of the room is not made yet; it is left out.")
            return
        self._done = True
        say(self._uploaded() if self._process.returncode == 0 else "The robot's map of the room could not be made.")

    def _uploaded(self) -> str:
        from tms_agents.simulation.survey import START  # these need numba and scipy, as the mapper does
        from tms_agents.slam.known import read_npz

        occupancy, origin, resolution = read_npz(self._out / "map.npz")
        name = self._room.replace(".", "-")
        about = MapIn(room=self._room, name="mapped by the robot", resolution=resolution, map_to_room=START)
        try:
            self._town.maps.put(name, about)
            made = self._town.maps.upload(
                name, occupancy, origin, agent=ROBOT_AGENT, snap=True, note="before the story"
            )
        except TownError as error:
            return f"The robot's map of the room did not get to the server: {error}"
        known = np.count_nonzero(np.isfinite(occupancy)) * resolution**2
        return (
            f"The robot drove once around and mapped {known:.0f} m2: the grey beneath the page's plan "
            f"(version {made.version}; tms map get {name} --out {name})."
        )


@contextmanager
def mapping(town: Town, room: str, folder: Path, seed: int, say: Callable[[str], None]) -> Iterator[RoomMap | None]:
    """The drive is simulated and the mapper started; None, and the reason said, where it lacks packages."""
    missing = next((name for name in ("numba", "scipy") if find_spec(name) is None), None)
    if missing is not None:
        say(f'no map of the room: the mapper needs {missing}: pip install "robot-town-tms[slam]"')
        yield None
        return
    from tms_agents.simulation.survey import recording

    drive, out = folder / "drive.jsonl", folder / "map"
    drive.write_text("\n".join(recording(np.random.default_rng([seed, 2]))) + "\n")
    with (folder / "map.log").open("wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "tms_client", "slam", "run", str(drive), "--out", str(out), "--threads", "1"],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,  # Ctrl-C is ours to handle
        )
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, process.pid, _NICE)
    try:
        yield RoomMap(town, room, out, process)
    finally:
        stop(process)
