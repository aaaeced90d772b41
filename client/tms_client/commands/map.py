"""``tms map``: send maps to a server, get them as files, list them, see what changed."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from tms_client.cli import ArgumentParser, CommandError
from tms_client.commands.options import add_server_options
from tms_client.errors import NotFound, TownError
from tms_client.flows import Retry, first_error
from tms_client.maps.files import Recorded, read_folder
from tms_client.town import Town
from tms_schemas.base import Pose
from tms_schemas.maps import DoorsAnswer, MapIn, MapObject, TownMap

_TIMEOUT_S = 60.0


def main(argv: Sequence[str]) -> int:
    parser = ArgumentParser(prog="tms map", description="Maps of a server.")
    actions = parser.add_subparsers(required=True, metavar="upload|get|list|versions|diff|doors|delete")
    _upload_options(actions.add_parser("upload", help="make a version of a folder of tms slam run, or of a map.yaml"))
    _get_options(actions.add_parser("get", help="write a map as map.pgm, map.yaml, map.png, map.npy"))
    listing = actions.add_parser("list", help="the maps")
    listing.add_argument("--room", help="only those of this room")
    listing.set_defaults(run=_list)
    versions = actions.add_parser("versions", help="the versions of a map, the newest first")
    versions.add_argument("map")
    versions.set_defaults(run=_versions)
    _diff_options(actions.add_parser("diff", help="what changed from one version to another"))
    _doors_options(actions.add_parser("doors", help="which doors of a room are open"))
    deleting = actions.add_parser("delete", help="forget a map with all its versions")
    deleting.add_argument("map")
    deleting.set_defaults(run=_delete)
    for action in actions.choices.values():
        add_server_options(action)
    arguments = parser.parse_args(argv)
    try:
        with Town(arguments.url, arguments.key, timeout_s=_TIMEOUT_S, retry=Retry(attempts=3)) as town:
            arguments.run(town, arguments)
    except TownError as error:
        raise CommandError(str(error)) from error
    return 0


def _upload_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", type=Path, help="folder with map.yaml (map.npy, imap.npy), or a map_server YAML file")
    parser.add_argument("--map", required=True, help="the map's id; it is made where there is none")
    parser.add_argument("--room", help="the room of a new map")
    parser.add_argument("--name", help="what people call a new map")
    parser.add_argument("--map-to-room", type=_pose, metavar="X,Y,THETA", help="pose of a new map's frame in the room")
    parser.add_argument("--agent", default="tms-map", help="who made it (default: tms-map)")
    parser.add_argument("--note", default="", help="what is to be said of this version")
    parser.add_argument("--snap", action="store_true", help="shift it to the map's grid, by up to half a cell")
    parser.set_defaults(run=_upload)


def _upload(town: Town, arguments: argparse.Namespace) -> None:
    recorded = read_folder(arguments.path)
    try:
        about = town.maps.get(arguments.map)
    except NotFound:
        about = _make(town, arguments, recorded)
    grid = recorded.grid
    if abs(about.resolution - grid.resolution) > 1e-9:
        raise CommandError(
            f"map {about.id} has cells of {about.resolution:g} m, {arguments.path} of {grid.resolution:g} m"
        )
    made = town.maps.upload(
        about.id,
        grid.occupancy,
        grid.origin,
        agent=arguments.agent,
        intensity=recorded.intensity,
        note=arguments.note,
        snap=arguments.snap,
    )
    if made.version == about.version:
        sys.stdout.write(f"{about.id}: nothing changed since version {made.version}\n")
    else:
        sys.stdout.write(f"{about.id}: version {made.version}, {made.changed} tiles changed\n")


def _make(town: Town, arguments: argparse.Namespace, recorded: Recorded) -> TownMap:
    if arguments.room is None:
        raise CommandError(f"there is no map {arguments.map!r} yet; --room says where to make it")
    try:
        fields = MapIn(
            room=arguments.room,
            name=arguments.name,
            resolution=recorded.grid.resolution,
            origin=recorded.grid.origin,
            map_to_room=arguments.map_to_room,
        )
    except ValidationError as error:
        raise CommandError(first_error(error)) from error
    return town.maps.put(arguments.map, fields)


def _get_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("map")
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument("--version", type=int, help="a version (default: the newest)")
    parser.set_defaults(run=_get)


def _get(town: Town, arguments: argparse.Namespace) -> None:
    """All files from one version, also where another one is made meanwhile."""
    found = town.map(arguments.map, version=arguments.version)
    if not found.occupancy.size:
        raise CommandError(f"map {found.name} has nothing in it in version {found.version}")
    name, version, out = found.name, found.version, arguments.out
    description = town.maps.yaml(name, version).replace(f"image: {name}.pgm", "image: map.pgm")
    with _writing(out):
        out.mkdir(parents=True, exist_ok=True)
        (out / "map.yaml").write_text(description, encoding="utf-8")
        (out / "map.pgm").write_bytes(town.maps.pgm(name, version))
        (out / "map.png").write_bytes(town.maps.png(name, version))
        np.save(out / "map.npy", found.occupancy)
        if found.intensity is not None:
            layers = (found.intensity.mean, found.intensity.variance, found.intensity.count.astype(np.float32))
            np.save(out / "imap.npy", np.stack(layers))
    height, width = found.occupancy.shape
    sys.stdout.write(f"{name} version {version}: {width} x {height} cells of {found.resolution:g} m in {out}\n")


def _list(town: Town, arguments: argparse.Namespace) -> None:
    for one in town.maps.list(arguments.room):
        name = f"  {one.name}" if one.name else ""
        sys.stdout.write(f"{one.id}  room {one.room}  version {one.version}  {one.resolution:g} m{name}\n")


def _versions(town: Town, arguments: argparse.Namespace) -> None:
    for one in town.maps.versions(arguments.map):
        note = f"  {one.note}" if one.note else ""
        at = one.created_at.isoformat(timespec="seconds")
        sys.stdout.write(f"{one.version}  {at}  {one.agent}  {one.changed} tiles changed{note}\n")


def _diff_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("map")
    parser.add_argument("before", type=int, help="a version, 0 for the empty map")
    parser.add_argument("after", type=int, nargs="?", help="a version (default: the newest)")
    parser.add_argument("--png", type=Path, metavar="FILE", help="write a picture of it")
    parser.add_argument("--least-m", type=float, default=0.0, metavar="M", help="leave out what moved less (m)")
    parser.add_argument("--least-deg", type=float, default=0.0, metavar="D", help="and turned less (degrees)")
    parser.set_defaults(run=_diff)


def _diff(town: Town, arguments: argparse.Namespace) -> None:
    found = town.maps.diff(
        arguments.map,
        arguments.before,
        arguments.after,
        least_m=arguments.least_m,
        least_rad=float(np.radians(arguments.least_deg)),
    )
    sys.stdout.write(
        f"{arguments.map} from version {found.before} to {found.after}: {len(found.tiles)} tiles changed; "
        f"cells that became occupied {found.became_occupied}, free {found.became_free}, "
        f"known {found.became_known}, unknown {found.became_unknown}\n"
    )
    for one in found.objects:
        by = "" if one.moved_m is None else f" ({one.moved_m:.2f} m, {np.degrees(one.turned_rad or 0.0):.0f} deg)"
        sys.stdout.write(f"  {one.tag}: {_standing(one.before)} -> {_standing(one.after)}{by}\n")
    if arguments.png is not None:
        with _writing(arguments.png):
            arguments.png.write_bytes(town.maps.diff_png(arguments.map, found.before, found.after))


def _standing(one: MapObject | None) -> str:
    if one is None:
        return "not there"
    state = f", {one.state}" if one.state else ""
    return f"x {one.x:.2f} m, y {one.y:.2f} m, {one.theta:.2f} rad{state}"


def _doors_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("room")
    parser.add_argument("--state", choices=["open", "closed", "unknown"], help="only doors in this state")
    parser.add_argument("--json", action="store_true", help="print the server's whole answer")
    parser.set_defaults(run=_doors)


def _doors(town: Town, arguments: argparse.Namespace) -> None:
    doors = town.doors(arguments.room, state=arguments.state)
    if arguments.json:
        sys.stdout.write(DoorsAnswer(doors=list(doors)).model_dump_json(indent=2) + "\n")
        return
    for one in doors:
        angle = "" if one.angle is None else f", {np.degrees(one.angle):.0f} deg"
        at = one.seen_at.isoformat(timespec="seconds")
        named = f" {one.name}" if one.name else ""
        sys.stdout.write(f"{one.tag}{named}: {one.state}{angle}  seen {at}  map {one.map} version {one.version}\n")
    if not doors:
        sys.stdout.write(f"no {arguments.state + ' ' if arguments.state else ''}doors in room {arguments.room}\n")


def _delete(town: Town, arguments: argparse.Namespace) -> None:
    town.maps.delete(arguments.map)


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise CommandError(f"{error.filename or path}: {error.strerror}") from error


def _pose(text: str) -> Pose:
    try:
        x, y, theta = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no pose like 1.5,0.2,1.57") from None
    return x, y, theta
