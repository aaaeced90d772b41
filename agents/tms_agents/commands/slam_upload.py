"""``tms slam run --upload MAP``: the map goes to the server while the log is worked on."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from pydantic import ValidationError

from tms_agents.commands.slam_log import pose
from tms_agents.robot.map_uploader import Grid, MapUploader
from tms_agents.slam.filter import ParticleFilter
from tms_agents.slam.gridmap import GridMap, grid_map
from tms_agents.slam.light.gridlight import GridLight, grid_light
from tms_client import NotFound, Town
from tms_client.cli import CommandError
from tms_client.commands.options import add_server_options
from tms_client.errors import TownError
from tms_client.flows import NO_RETRY, first_error
from tms_client.maps.cells import Intensity
from tms_schemas.maps import MapIn

#: The finished map is offered for so long to a server that is away.
_PATIENCE_S = 120.0


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--upload", metavar="MAP", help="id of a map on the server, to which changed tiles go meanwhile"
    )
    parser.add_argument("--upload-every", type=float, default=2.0, metavar="S", help="seconds between uploads (2)")
    parser.add_argument("--agent", default="slam", help="who uploads (default: slam)")
    parser.add_argument("--room", help="the room of a new map")
    parser.add_argument("--map-to-room", type=pose, metavar="X,Y,THETA", help="where the drive began in the room")
    add_server_options(parser)


class Upload:
    """Given to the mapper as ``watch``, and the finished map at the end."""

    def __init__(self, map: str = "", uploader: MapUploader | None = None) -> None:
        self._map, self._uploader = map, uploader

    def watch(self, particles: ParticleFilter) -> None:
        if self._uploader is not None:
            self._uploader.offer(lambda: _so_far(particles))

    def finish(self, grid: GridMap, light: GridLight | None = None) -> str:
        """In words, to be added to what the command says."""
        if self._uploader is None:
            return ""
        made = self._uploader.finish(_grid(grid, light), _PATIENCE_S)
        return f"; map {self._map} on the server is at version {made.version}"


@contextmanager
def uploading(arguments: argparse.Namespace) -> Iterator[Upload]:
    """Makes the map where there is none. Raises ``CommandError`` for whatever the server refuses."""
    if arguments.upload is None:
        yield Upload()
        return
    if not 0.1 <= arguments.upload_every <= 3600:
        raise CommandError("--upload-every: from 0.1 to 3600 s")
    try:
        with Town(arguments.url, arguments.key, retry=NO_RETRY) as town:
            _require_map(town, arguments)
            yield Upload(
                arguments.upload, MapUploader(town, arguments.upload, arguments.agent, arguments.upload_every, _say)
            )
    except TownError as error:
        raise CommandError(f"map {arguments.upload}: {error}") from error


def _require_map(town: Town, arguments: argparse.Namespace) -> None:
    try:
        about = town.maps.get(arguments.upload)
    except NotFound:
        if arguments.room is None:
            raise CommandError(f"there is no map {arguments.upload!r} yet; --room says where to make it") from None
        try:
            fields = MapIn(room=arguments.room, resolution=arguments.resolution, map_to_room=arguments.map_to_room)
        except ValidationError as error:
            raise CommandError(first_error(error)) from error
        town.maps.put(arguments.upload, fields)
        return
    if abs(about.resolution - arguments.resolution) > 1e-9:
        raise CommandError(f"map {about.id} has cells of {about.resolution:g} m, not {arguments.resolution:g} m")


def _so_far(particles: ParticleFilter) -> Grid:
    """The best particle's map, and its light along its path."""
    grid = grid_map(particles.maps, particles.best)
    light = None if particles.light is None else grid_light(grid, particles.path(), particles.light.scans)
    return _grid(grid, light)


def _grid(grid: GridMap, light: GridLight | None) -> Grid:
    """Light as in ``imap.npy``: in comparison with a usual surface."""
    if light is None:
        return Grid(grid.probabilities(), grid.origin)
    mean = light.reflectance()
    layers = Intensity(
        mean.astype(np.float32), (mean**2 * light.variance).astype(np.float32), light.count.astype(np.uint32)
    )
    return Grid(grid.probabilities(), grid.origin, layers)


def _say(text: str) -> None:
    sys.stderr.write(f"{text}\n")
