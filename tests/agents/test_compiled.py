"""A kernel is compiled anew when what it calls has changed, and only then."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tms_agents import compiled

_RUN = """
import town_kernels.compiled
from town_kernels.caller import answer
print(answer(1.0), sum(answer.stats.cache_hits.values()))
"""
_KILLED = """
import os
from numba.core.caching import IndexDataCacheFile
IndexDataCacheFile._save_data = lambda self, name, data: os._exit(0)
"""
_CALLER = """
from numba import njit
from town_kernels.callee import (
    called,
)

@njit(cache=True)
def answer(x):
    return called() + x
"""
_CALLEE = """
from numba import njit
from town_kernels.number import NUMBER

@njit(cache=True)
def called():
    return NUMBER
"""
_BY_PACKAGE = """
from numba import njit
from town_kernels import deep

@njit(cache=True)
def answer(x):
    return deep.NUMBER + x
"""
_KERNELS = """
import importlib, pkgutil, sys
package = importlib.import_module(sys.argv[1])
for found in pkgutil.iter_modules(package.__path__, package.__name__ + "."):
    if not found.ispkg:
        for name, value in vars(importlib.import_module(found.name)).items():
            cache = getattr(getattr(value, "_cache", None), "_impl", None)
            if cache is not None and value.py_func.__module__ == found.name:
                print(type(cache.locator).__name__, f"{found.name}.{name}")
"""
_AGENTS = Path(compiled.__file__).parent
_WITH_KERNELS = sorted(
    {
        ".".join(("tms_agents", *source.relative_to(_AGENTS).parent.parts))
        for source in _AGENTS.rglob("*.py")
        if "njit(cache=True" in source.read_text(encoding="utf-8")
    }
)


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package of three modules, each of which is compiled into the one before; with the locator of ours."""
    package = tmp_path / "town_kernels"
    package.mkdir()
    shutil.copy(compiled.__file__, package / "compiled.py")
    (package / "__init__.py").touch()
    (package / "caller.py").write_text(_CALLER)
    (package / "callee.py").write_text(_CALLEE)
    (package / "number.py").write_text("NUMBER = 2.0\n")
    (package / "other.py").write_text("NUMBER = 2.0\n")
    return package


def run(package: Path, **extra: str) -> tuple[float, int]:
    """What the kernel says in a process of its own, and how many kernels it found on disk."""
    mine = environment(package) | extra
    done = subprocess.run([sys.executable, "-c", _RUN], env=mine, capture_output=True, text=True, check=True)
    said, found = done.stdout.split()
    return float(said), int(found)


def environment(package: Path) -> dict[str, str]:
    """Of a process that runs the kernels."""
    mine = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    return mine | {"PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1"}


@pytest.mark.parametrize("folder", ["", "elsewhere"])
def test_what_a_kernel_calls_has_changed(package: Path, tmp_path: Path, folder: str) -> None:
    where = {"NUMBA_CACHE_DIR": str(tmp_path / folder)} if folder else {}
    assert run(package, **where) == (3.0, 0)
    assert run(package, **where) == (3.0, 1)
    (package / "other.py").write_text("NUMBER = 7.0\n")
    assert run(package, **where) == (3.0, 1)
    (package / "number.py").write_text("NUMBER = 5.0\n")
    assert run(package, **where) == (6.0, 0)
    assert run(package, **where) == (6.0, 1)


def test_a_process_is_killed_while_it_keeps_a_kernel(package: Path) -> None:
    """Its index is written, what that points to is not: there is the code of the version before."""
    assert run(package) == (3.0, 0)
    (package / "number.py").write_text("NUMBER = 5.0\n")
    subprocess.run([sys.executable, "-c", _KILLED + _RUN], env=environment(package), check=True)
    assert run(package)[0] == 6.0


@pytest.mark.parametrize("most", [0, 2000])
def test_a_full_disk_keeps_no_kernel_from_its_work(package: Path, most: int) -> None:
    """Nothing can be written, or the index and not the code: that is said once, and it is kept when there is place."""
    full = f"import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, ({most}, {most}))\n"
    done = subprocess.run(
        [sys.executable, "-c", full + _RUN], env=environment(package), capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["3.0", "0"]
    assert done.stderr == "what was compiled cannot be kept (File too large): it is compiled again at the next start\n"
    assert run(package) == (3.0, 0)
    assert run(package) == (3.0, 1)


def test_kernels_of_the_version_before_go(package: Path) -> None:
    run(package)
    before = {path.name for path in package.rglob("*.nb[ci]")}
    (package / "number.py").write_text("NUMBER = 5.0\n")
    run(package)
    after = {path.name for path in package.rglob("*.nb[ci]")}
    assert len(after) == len(before) and not after & before


def test_what_is_imported_is_a_module_or_comes_by_a_package(package: Path) -> None:
    (package / "deep").mkdir()
    (package / "deep" / "__init__.py").write_text("from town_kernels.number import NUMBER\n")
    (package / "caller.py").write_text(_BY_PACKAGE)
    assert run(package) == (3.0, 0)
    (package / "number.py").write_text("NUMBER = 5.0\n")
    assert run(package) == (6.0, 0)


def test_who_names_a_locator_has_it(package: Path) -> None:
    named = {"NUMBA_CACHE_LOCATOR_CLASSES": "InTreeCacheLocator"}
    assert run(package, **named) == (3.0, 0)
    (package / "number.py").write_text("NUMBER = 5.0\n")
    assert run(package, **named) == (3.0, 1)  # as numba does it


@pytest.mark.parametrize("name", _WITH_KERNELS)
def test_every_kernel_that_is_kept_has_the_locator(name: str) -> None:
    """Whichever package is imported first: each in a process of its own, and nothing before it."""
    done = subprocess.run([sys.executable, "-c", _KERNELS, name], capture_output=True, text=True, check=True)
    kernels = done.stdout.splitlines()
    assert kernels
    assert [line for line in kernels if not line.startswith("KernelLocator ")] == []
