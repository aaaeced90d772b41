"""The ``tms`` command: dispatch, exit statuses and one-line errors."""

from __future__ import annotations

from importlib import metadata

import pytest

from tms_client import cli


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch):
    """Replace the installed commands by the given entry points (name -> value)."""

    def install(**values: str) -> None:
        points = metadata.EntryPoints(
            metadata.EntryPoint(name=name, value=value, group=cli.GROUP) for name, value in values.items()
        )
        monkeypatch.setattr(cli.metadata, "entry_points", lambda group: points)

    return install


def echo(argv: list[str]) -> int:
    print("|".join(argv))
    return 7


def bad(argv: list[str]) -> int:
    raise cli.CommandError("first\nsecond")


def interrupted(argv: list[str]) -> int:
    raise KeyboardInterrupt


def parse(argv: list[str]) -> int:
    cli.ArgumentParser(prog="tms parse").parse_args(argv)
    return 0


@pytest.fixture(autouse=True)
def _here(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "the_commands", sys.modules[__name__])


def test_arguments_and_status_pass_through(commands, capsys):
    commands(echo="the_commands:echo")
    assert cli.main(["echo", "a", "--b"]) == 7
    assert capsys.readouterr().out == "a|--b\n"


def test_help_lists_the_commands_without_importing_them(commands, capsys):
    commands(one="no_such_module:main", two="neither:main")
    for argv in ([], ["--help"]):
        assert cli.main(argv) == 0
        out = capsys.readouterr().out
        assert "  one\n" in out and "  two\n" in out


def test_version(capsys):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"tms {metadata.version('robot-town-tms')}\n"


@pytest.mark.parametrize(
    ("value", "argv", "status", "says"),
    [
        ("the_commands:bad", ["x"], 2, "tms: first second\n"),
        ("the_commands:interrupted", ["x"], 130, ""),
        (
            "the_commands:parse",
            ["x", "--nope"],
            2,
            "tms: unrecognized arguments: --nope (try tms parse --help)\n",
        ),
        (
            "absent_library:main [server]",
            ["x"],
            2,
            "tms: 'x' needs absent_library, which is not installed: pip install \"robot-town-tms[server]\"\n",
        ),
        ("the_commands:echo", ["y"], 2, "tms: unknown command 'y'; there are: x\n"),
    ],
)
def test_failures_are_one_line(commands, capsys, value, argv, status, says):
    commands(x=value)
    assert cli.main(argv) == status
    assert capsys.readouterr().err == says
