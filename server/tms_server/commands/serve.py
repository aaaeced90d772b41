"""``tms serve``: the server. It binds to loopback unless told otherwise, and other binds need keys."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pydantic import ValidationError

from tms_client.cli import ArgumentParser, CommandError
from tms_server.compiled import use_compiled_cache
from tms_server.settings import Settings


def main(argv: Sequence[str]) -> int:
    parser = ArgumentParser(prog="tms serve", description="Run the TMS server.")
    parser.add_argument("--host", help="address to bind (default 127.0.0.1)")
    parser.add_argument("--port", type=int, help="port (default 8080; 0 picks a free one)")
    parser.add_argument("--data-dir", type=Path, help="where the embedded database and compiled code live")
    parser.add_argument("--database-url", help="postgresql://... instead of the embedded SQLite")
    given = {name: value for name, value in vars(parser.parse_args(argv)).items() if value is not None}
    try:
        settings = Settings(**given)
    except ValidationError as error:
        wrong = error.errors()[0]
        name = ".".join(str(part) for part in wrong["loc"])
        raise CommandError(f"{name} (TMS_{name.upper()}): {wrong['msg']}, got {wrong['input']!r}") from error
    settings.data_dir.mkdir(parents=True, exist_ok=True)
    use_compiled_cache(settings.data_dir)
    from tms_server.commands.serving import serve  # numba reads its cache directory on import

    return serve(settings)
