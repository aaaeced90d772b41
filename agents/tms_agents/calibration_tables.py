"""Calibrations in a TOML file beside the configuration: a table per board or laser."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from tms_agents.config import Section
from tms_agents.files import write_atomically
from tms_client.cli import CommandError

S = TypeVar("S", bound=Section)


def read_tables(path: Path, model: type[S]) -> dict[str, S]:
    """Calibrations by name; none where there is no file.

    Raises:
        CommandError: the file cannot be read or says something impossible.
    """
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise CommandError(f"{path}: {error}") from error
    found: dict[str, S] = {}
    for name, values in raw.items():
        try:
            found[name] = model.model_validate(values)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            raise CommandError(f"{path}: {'.'.join(map(str, (name, *first['loc'])))}: {first['msg']}") from error
    return found


def write_tables(path: Path, tables: Mapping[str, Section], remark: str) -> Path | None:
    """Replace the file in one step; the former one is kept beside it, as ``.old`` (returned where there was one).

    Raises:
        CommandError: the folder cannot be written.
    """
    text = f"# {remark}\n" + "".join(f"\n[{_quoted(name)}]\n{_table(one)}" for name, one in tables.items())
    old = path.with_name(path.name + ".old") if path.exists() else None
    try:
        if old is not None:
            write_atomically(old, path.read_bytes())
        write_atomically(path, text.encode())
    except OSError as error:
        raise CommandError(f"{path}: {error.strerror}") from error
    return old


def _table(table: Section) -> str:
    lines = []
    for name, value in table.model_dump(exclude_none=True).items():
        if isinstance(value, datetime):
            text = value.isoformat(timespec="seconds")
        elif isinstance(value, list):
            text = f"[{', '.join(str(list(one)) if isinstance(one, tuple) else repr(one) for one in value)}]"
        elif isinstance(value, str):
            text = _quoted(value)
        else:
            text = repr(value)
        lines.append(f"{name} = {text}\n")
    return "".join(lines)


def _quoted(name: str) -> str:
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'
