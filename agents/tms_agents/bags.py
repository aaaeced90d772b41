"""Messages out of ROS bags (ROS 1 .bag; ROS 2 .db3, .mcap or the folder of them); needs the extra ``rosbags``."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

from tms_client.cli import CommandError


def is_bag(path: Path) -> bool:
    """Whether it looks like one, by its name."""
    return path.suffix.lower() in (".bag", ".db3", ".mcap") or path.is_dir()


def read_messages(path: Path, types: Collection[str]) -> dict[str, list[Any]]:
    """All messages of the ``types`` (``sensor_msgs/msg/LaserScan``), by topic, in the order of the bag.

    Raises:
        CommandError: ``rosbags`` is not installed.
        ValueError: it is no bag, or is damaged.
        OSError: it cannot be read.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise CommandError(f'{path}: reading ROS bags needs pip install "robot-town-tms[rosbags]"') from error
    bag = _bag(path)
    bag.stat()
    if bag.is_dir() and not (bag / "metadata.yaml").is_file():
        raise ValueError("the folder is no bag: there is no metadata.yaml in it")
    # Bags of ROS 2 do not always describe their messages; those read here never changed.
    known = get_typestore(Stores.ROS2_HUMBLE)
    topics: dict[str, list[Any]] = {}
    try:
        with AnyReader([bag], default_typestore=known) as reader:
            wanted = [one for one in reader.connections if one.msgtype in types]
            for connection, _, raw in reader.messages(connections=wanted) if wanted else ():
                topics.setdefault(connection.topic, []).append(reader.deserialize(raw, connection.msgtype))
    except OSError:
        raise
    except Exception as error:
        # Of a damaged bag the reader trips over whatever it meets: struct, sqlite3, zstd, KeyError, AssertionError ...
        words = str(error) if " " in str(error) else f"{type(error).__name__} {error}"
        raise ValueError(f"the bag cannot be read: {words.strip()}") from error
    return topics


def _bag(path: Path) -> Path:
    """What the reader wants to open: of a ROS 2 bag, the folder with its metadata."""
    if path.suffix.lower() in (".db3", ".mcap") and (path.parent / "metadata.yaml").is_file():
        return path.parent
    return path
