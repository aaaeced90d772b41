"""``tms catalogue models``: things with their shapes and tags into the object database, from a ``models.json``.

Robots that map ask the server for them by tag, so that no robot needs the file.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from tms_client.cli import CommandError
from tms_client.commands.options import add_server_options
from tms_client.errors import NotFound, TownError
from tms_client.flows import first_error
from tms_client.town import Town
from tms_schemas.base import Name, Pose, Tag
from tms_schemas.objects import ObjectFields, Shape


class _Thing(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)

    class_: str = Field(alias="class")
    polygon: Any
    parts: Any = []
    tag_pose: Pose
    name: Name | None = None


class _Models(BaseModel):
    model_config = ConfigDict(extra="ignore")

    tags: dict[Tag, _Thing]


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="MODELS.json", help="as of a recording: class, polygons, tag pose")
    parser.add_argument("--room", help="the room of things that are new")
    add_server_options(parser)
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    """A thing that is registered keeps its name and all else; a new one is named after its class and tag."""
    things = _read(arguments.file)
    new = 0
    try:
        with Town(arguments.url, arguments.key) as town:
            for tag, (name, shape, tag_pose) in things.items():
                try:
                    town.objects.patch(tag, shape=shape, tag_pose=tag_pose)
                except NotFound:
                    fields = ObjectFields(
                        name=name, room=arguments.room, tracking="map", shape=shape, tag_pose=tag_pose
                    )
                    town.objects.put(tag, fields)
                    new += 1
    except TownError as error:
        raise CommandError(str(error)) from error
    sys.stdout.write(f"{len(things)} shapes stored, {new} of things that are new\n")
    return 0


def _read(path: Path) -> dict[str, tuple[str, Shape, Pose]]:
    try:
        found = _Models.model_validate(json.loads(path.read_bytes()))
        return {
            tag: (
                one.name or f"{one.class_} {tag[-4:]}",
                Shape.model_validate({"class": one.class_, "polygon": one.polygon, "parts": one.parts}),
                one.tag_pose,
            )
            for tag, one in found.tags.items()
        }
    except ValidationError as error:
        raise CommandError(f"{path}: {first_error(error)}") from error
    except (OSError, ValueError, RecursionError) as error:
        raise CommandError(f"{path}: {getattr(error, 'strerror', None) or error}") from error
