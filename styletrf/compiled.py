"""Functions that numba compiles, and the folder in which their compiled code is kept.

numba keeps the code of a function while the function's own file stays the same. But functions and
constants of other files may be compiled into it, so that the kept code may be stale. Here the
folder is named by all files of the function's own folder, numba's version and the processor.
Where one of them changes, another folder begins, and everything is compiled again.
"""

import contextlib
import functools
import hashlib
import os
import shutil
from collections.abc import Callable, Iterator
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba

KEPT_FOLDERS = 8
"""How many folders of a package are kept, for branches and processors that share a checkout."""


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Returns the decorator `numba.njit(**options)`, whose compiled code is kept and never stale.

    All code of the project that a function calls or reads has to lie in files of its own folder,
    not in packages below it; a test checks this.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        package = Path(function.__code__.co_filename).parent
        with _kept_in(folder_of_code(package)):
            return numba.njit(cache=True, **options)(function)

    return decorate


@functools.cache
def folder_of_code(package: Path) -> Path:
    """Returns the folder for the compiled code of a package, made where there is none.

    It lies below NUMBA_CACHE_DIR, or else where Python keeps bytecode, or in the user's cache
    folder where that cannot be written to. Older folders beside it go, see `KEPT_FOLDERS`.
    """
    prefix = f"styletrf-{package.name}-"
    folders = [parent / f"{prefix}{_digest(package)}" for parent in _parents(package)]
    folder = next(filter(_is_usable, folders), folders[-1])
    _remove_old(folder.parent, prefix)
    return folder


def _is_usable(folder: Path) -> bool:
    """Returns whether a folder can be written to; it is made if missing, and is now the newest."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
    except OSError:
        return False
    return True


def _parents(package: Path) -> Iterator[Path]:
    if numba.config.CACHE_DIR:  # type: ignore[attr-defined]
        yield Path(numba.config.CACHE_DIR)  # type: ignore[attr-defined]
    yield Path(cache_from_source(os.fspath(package / "__init__.py"))).parent
    yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "styletrf"


def _digest(package: Path) -> str:
    """Returns a digest of all that compiled code depends on; numba checks processor features."""
    made_by = f"{numba.__version__} {llvmlite.binding.get_host_cpu_name()}\n"
    hasher = hashlib.sha256(made_by.encode())
    for path in sorted(package.glob("*.py")):
        text = path.read_bytes()
        hasher.update(f"{path.name} {len(text)}\n".encode() + text)
    return hasher.hexdigest()[:16]


def _remove_old(parent: Path, prefix: str) -> None:
    """Removes all folders but the newest; a process that still uses one compiles again."""
    with contextlib.suppress(OSError):  # another process removes the same ones
        folders = sorted(parent.glob(f"{prefix}*"), key=lambda each: each.stat().st_mtime)
        for folder in folders[:-KEPT_FOLDERS]:
            shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def _kept_in(folder: Path) -> Iterator[None]:
    """Has numba, which looks at its configuration when it decorates, keep code there."""
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    numba.config.CACHE_DIR = os.fspath(folder)  # type: ignore[attr-defined]
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]
