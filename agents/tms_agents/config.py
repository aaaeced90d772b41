"""What every agent's TOML file says: who it is, where it posts, where its spool lies."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo
from pydantic.functional_validators import AfterValidator

from tms_client.cli import CommandError
from tms_client.commands.options import DEFAULT_URL
from tms_schemas.base import AgentId, RoomId


class Section(BaseModel):
    """Base of all sections: a misspelt name is an error, not a silent default."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)


def _beside_the_file(path: Path, info: ValidationInfo) -> Path:
    folder = (info.context or {}).get("folder", Path())
    return Path(folder) / path.expanduser()


#: A path; relative ones start at the folder of the configuration file.
LocalPath = Annotated[Path, AfterValidator(_beside_the_file)]
Seconds = Annotated[float, Field(gt=0, le=86_400)]


class Server(Section):
    """``TMS_URL`` and ``TMS_KEY`` of the environment win over the file, so that keys can stay out of it."""

    url: str = Field(default=DEFAULT_URL, pattern=r"^https?://\S+$")
    key: str | None = None
    batch: Annotated[int, Field(ge=1, le=1000)] = 500
    linger_s: Annotated[float, Field(ge=0, le=60)] = 0.02


class SpoolSection(Section):
    path: LocalPath
    max_items: Annotated[int, Field(ge=1)] = 200_000
    max_bytes: Annotated[int, Field(ge=1000)] = 64_000_000


class AgentConfig(Section):
    agent: AgentId
    room: RoomId
    server: Server = Server()
    spool: SpoolSection


C = TypeVar("C", bound=Section)


def read_config(path: Path, model: type[C]) -> C:
    """Read and validate a configuration file.

    Raises:
        CommandError: the file is missing, no TOML, or says something wrong (named with its place).
    """
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise CommandError(f"{path}: no such file") from error
    except OSError as error:
        raise CommandError(f"{path}: {error.strerror or error}") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise CommandError(f"{path}: {error}") from error
    _from_environment(raw)
    try:
        return model.model_validate(raw, context={"folder": path.resolve().parent})
    except ValidationError as error:
        raise CommandError(f"{path}: {faults_of(error)}") from error


def faults_of(error: ValidationError) -> str:
    """What is wrong, and where, in one line."""
    return "; ".join(_in_words(one["loc"], _brackets(one) or one["msg"]) for one in error.errors(include_url=False)[:5])


def misplaced(place: Sequence[str | int], why: str) -> ValidationError:
    """For validators of a whole section: what is wrong, at its place in the section."""
    ctx = {"error": ValueError(why)}
    return ValidationError.from_exception_data(
        "", [{"type": "value_error", "loc": tuple(place), "input": None, "ctx": ctx}]
    )


def need_names_of_their_own(what: str, names: Sequence[str]) -> None:
    """For validators of a list of sections that have a ``name``.

    Raises:
        ValidationError: at the name that another one has already.
    """
    for number, name in enumerate(names):
        if name in names[:number]:
            raise misplaced((number, "name"), f"two {what}s are called {name!r}: give each its name")


def _brackets(one: Mapping[str, Any]) -> str:
    """[lasers] for [[lasers]], or the other way round: that a list is wanted says little to who writes a file."""
    if len(one["loc"]) != 1:
        return ""
    (name,), given = one["loc"], one["input"]
    if one["type"] == "list_type" and isinstance(given, dict):
        return f"this section is given once for each: write [[{name}]], with two brackets"
    if one["type"] == "model_type" and isinstance(given, list) and given and isinstance(given[0], dict):
        return f"there is one such section: write [{name}], with one bracket"
    return ""


def _in_words(place: Sequence[str | int], what: str) -> str:
    """Where, if it is not the file as a whole, and what."""
    return ": ".join(filter(None, (".".join(map(str, place)), what.removeprefix("Value error, "))))


def _from_environment(raw: dict[str, Any]) -> None:
    given = {name: value for name in ("url", "key") if (value := os.environ.get(f"TMS_{name.upper()}"))}
    if given and isinstance(raw.setdefault("server", {}), dict):
        raw["server"] |= given
