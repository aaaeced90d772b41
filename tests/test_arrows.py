"""Imports point one way: schemas <- client <- agents, schemas <- server; belief and mapping know no HTTP or SQL."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

#: Package (or folder of one) -> what it may import beside the standard library. The longest prefix decides.
ALLOWED: dict[str, set[str]] = {
    "tms_schemas": {"pydantic"},
    "tms_client": {"tms_schemas", "pydantic", "httpx", "websockets"},
    "tms_client/maps": {"tms_schemas", "tms_client", "pydantic", "numpy", "PIL", "yaml"},
    "tms_client/commands": {"tms_schemas", "tms_client", "pydantic", "numpy"},
    "tms_agents": {
        *("tms_schemas", "tms_client", "pydantic", "pydantic_settings", "httpx"),
        *("numpy", "numba", "scipy", "PIL", "serial", "pymodbus", "rosbags"),
    },
    "tms_agents/slam": {"tms_agents/slam", "tms_agents/compiled", "numpy", "numba", "scipy", "PIL"},
    "tms_server": {
        *("tms_schemas", "tms_migrations", "pydantic", "pydantic_settings", "pydantic_core", "fastapi", "starlette"),
        *("sqlalchemy", "alembic", "uvicorn", "numpy", "numba", "PIL", "biip", "epcpy", "fastapi_offline", "asyncpg"),
    },
    "tms_server/commands": {"tms_schemas", "tms_server", "tms_client", "pydantic", "sqlalchemy", "uvicorn"},
    "tms_server/placement": {"tms_schemas", "tms_server/placement", "numpy", "numba", "pydantic"},
    "tms_migrations": {"tms_server", "alembic", "sqlalchemy", "pydantic"},
}
#: What the floor estimator consists of; each may import itself and those before it, and nothing that does I/O.
FLOOR = ["scan", "feet", "association", "robots", "movers", "objects"]
ALLOWED |= {
    f"tms_agents/floor/{room}": {
        *("numpy", "numba"),
        *(
            f"tms_agents/floor/{one}"
            for one in ("norm", "state", "settings", "events", *FLOOR[: FLOOR.index(room) + 1])
        ),
    }
    for room in FLOOR
}


def sources() -> Iterator[tuple[str, Path]]:
    for folder in ("schemas", "client", "agents", "server", "migrations"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield path.relative_to(ROOT / folder).as_posix(), path


@pytest.mark.parametrize(("name", "path"), [pytest.param(name, path, id=name) for name, path in sources()])
def test_imports_follow_the_arrows(name: str, path: Path) -> None:
    room = max((prefix for prefix in ALLOWED if name.startswith(prefix + "/")), key=len)
    allowed = ALLOWED[room] if "/" in room else ALLOWED[room] | {room}
    for line, module in imports(path):
        top = module.split(".")[0]
        if top in sys.stdlib_module_names:
            continue
        inside = module.replace(".", "/")
        assert any(inside == name or inside.startswith(name + "/") for name in allowed), (
            f"{name}:{line} imports {module}; {room} may import {sorted(allowed)}"
        )


def test_no_modules_import_each_other_in_a_circle() -> None:
    """Not for types alone, either: what a part is given is a protocol beside it."""
    paths = {name.removesuffix(".py").removesuffix("/__init__").replace("/", "."): path for name, path in sources()}
    graph = {module: set(imported(path, set(paths))) for module, path in paths.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail("a circle: " + " <- ".join(error.args[1]))


def imported(path: Path, known: set[str]) -> Iterator[str]:
    """Which of the ``known`` modules a file imports. Who takes a module from its package does not mean the package."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                module = f"{node.module}.{alias.name}"
                yield from (one for one in [module if module in known else node.module] if one in known)


def imports(path: Path) -> Iterator[tuple[int, str]]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: write imports in full"
            yield node.lineno, node.module or ""


def test_no_clock_or_generator_is_global() -> None:
    """Time and randomness are parameters; only the system clock itself reads the clock."""
    forbidden = {"datetime.now", "datetime.utcnow", "time.time", "random.random", "random.choice", "random.seed"}
    exempt = {"tms_server/clock.py"}
    for name, path in sources():
        if name in exempt:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in forbidden:
                pytest.fail(f"{name}:{node.lineno} calls {ast.unparse(node.func)}: take a clock or a generator")


def test_secrets_are_compared_in_constant_time() -> None:
    """No ``==`` on the digest or secret of a key."""
    for name, path in sources():
        if not name.startswith(("tms_server/auth", "tms_server/keys")):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Compare) and any(isinstance(op, ast.Eq | ast.NotEq) for op in node.ops):
                text = ast.unparse(node).lower()
                assert "digest" not in text and "secret" not in text, f"{name}:{node.lineno}: use hmac.compare_digest"
