"""Compiled kernels are stale when any module they were compiled from has changed, not only their own.

numba takes what a kernel calls into its machine code, but keeps it on disk for as long as the file of the kernel itself
is the same (https://github.com/numba/numba/issues/1833): after an update that changed only what is called, the old code
would go on running. The stamp here is of that file and of all in this package that it imports, and they import. To be
imported before the first kernel is decorated: by each package that has some.

Where a kernel cannot be kept (the disk is full) it is used all the same.
"""

from __future__ import annotations

import hashlib
import logging
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import Cache, CacheImpl

log = logging.getLogger(__name__)
_PACKAGE = Path(__file__).resolve().parent
_IMPORT = re.compile(
    rf"^\s*from ({_PACKAGE.name}[\w.]*) import (\([^)]*\)|.*)|^\s*import ({_PACKAGE.name}[\w.]*)", re.M
)


class KernelLocator:
    """Where numba's own locator keeps a kernel, but with `stamp` for those of this package."""

    def __init__(self, found: Any, source: Path) -> None:
        self._found, self._source = found, source
        self.get_cache_path: Callable[[], str] = found.get_cache_path

    def get_source_stamp(self) -> bytes:
        return stamp(self._source)

    def get_disambiguator(self) -> str:
        return f"{self._found.get_disambiguator()}-{version(self._source)}"

    def ensure_cache_path(self) -> None:
        """Called before a kernel is kept: those of the same file as it was before go."""
        self._found.ensure_cache_path()
        for kept in Path(self.get_cache_path()).glob(f"{self._source.stem}.*.nb[ci]"):
            if version(self._source) not in kept.name:
                kept.unlink(missing_ok=True)

    @classmethod
    def from_function(cls, kernel: Callable[..., Any], source: str) -> Any:
        """A locator, or None where numba has none."""
        locators: list[Any] = CacheImpl._locator_classes
        tried = (locator.from_function(kernel, source) for locator in locators)
        found = next((one for one in tried if one is not None), None)
        path = Path(source).resolve()
        return cls(found, path) if found is not None and _PACKAGE in path.parents and path.exists() else found


_config: Any = numba.config
if not _config.CACHE_LOCATOR_CLASSES:  # ``NUMBA_CACHE_LOCATOR_CLASSES``: who sets it has a reason
    _config.CACHE_LOCATOR_CLASSES = f"{__name__}.{KernelLocator.__qualname__}"

_keep: Any = Cache.save_overload


def keep_if_possible(self: Any, signature: Any, kernel: Any) -> None:
    """numba would end the program where what it has just compiled cannot be written."""
    try:
        _keep(self, signature, kernel)
    except OSError as error:
        _say_once(error.strerror or str(error))


@cache
def _say_once(why: str) -> None:
    log.warning("what was compiled cannot be kept (%s): it is compiled again at the next start", why)


_cache: Any = Cache
_cache.save_overload = keep_if_possible


@cache
def stamp(source: Path) -> bytes:
    """A digest of all that a kernel in this file may have been compiled from."""
    return hashlib.sha256(b"".join(_digest(one) for one in sorted(sources(source)))).digest()


def version(source: Path) -> str:
    """The same in short, as it is in the names of the files in which kernels are kept."""
    return stamp(source).hex()[:12]


@cache
def sources(source: Path) -> frozenset[Path]:
    """The file and all of this package that it imports, directly or not."""
    found, left = set(), [source]
    while left:
        one = left.pop()
        if one not in found:
            found.add(one)
            left += _imported(one)
    return frozenset(found)


@cache
def _imported(source: Path) -> tuple[Path, ...]:
    names = _names(source.read_text(encoding="utf-8"))
    files = (_PACKAGE.parent.joinpath(*name.split(".")) for name in names)
    may_be = (path for file in files for path in (file.with_suffix(".py"), file / "__init__.py"))
    return tuple(path for path in may_be if path.exists())


def _names(text: str) -> Iterator[str]:
    """What is imported from a module may be a module itself."""
    for module, those, alone in _IMPORT.findall(text):
        yield module or alone
        yield from (f"{module}.{word}" for word in re.findall(r"\w+", those))


@cache
def _digest(source: Path) -> bytes:
    return hashlib.sha256(source.read_bytes()).digest()
