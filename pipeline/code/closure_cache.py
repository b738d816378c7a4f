"""Closures of code on disk, for as long as no file of the project changes.

Following a task's code means parsing all of the project, which takes seconds for all families.
What it finds depends on nothing but the files, the Python that parses them, the code that follows
them, and the class. So it is kept below a digest of these, where Python keeps bytecode, and only
for the files as they are now. What is absent or damaged there, or cannot be written, is computed.
"""

import contextlib
import json
import os
import shutil
import sys
from collections.abc import Callable, Iterable
from importlib.util import cache_from_source
from pathlib import Path

from pipeline.canonical import canonical_json
from pipeline.code.source import package_files
from pipeline.digest import file_digest, typed_digest

Closure = dict[str, str]


def cached_closure(
    name: str, packages: Iterable[str], follow: Callable[[], Closure], folder: Path | None = None
) -> Closure:
    """Returns what `follow` returns, from the cache if these packages are as they were then.

    Args:
        name: Of the class, with its module.
        packages: All that `follow` may read.
        follow: Computes the closure.
        folder: Of the cache; where Python keeps the bytecode of this file by default.
    """
    packages = sorted(packages)
    root = folder or Path(cache_from_source(__file__)).parent / "closures"
    try:
        files = sources_digest(packages)
    except OSError:  # a file has vanished, or cannot be read
        return follow()
    path = root / files / f"{typed_digest('closure-name', name.encode())[:16]}.json"
    if (kept := _kept(path, name)) is not None:
        return kept
    closure = follow()
    with contextlib.suppress(OSError):
        if sources_digest(packages) == files:  # else it may be of newer files
            _keep(path, name, closure)
    return closure


def sources_digest(packages: Iterable[str]) -> str:
    """Returns a digest of all files of the packages by name, of Python, and of what follows them.

    Raises:
        OSError: A file has vanished, or cannot be read, now or when this module was imported.
    """
    if not _FOLLOWED_BY:
        raise FileNotFoundError("a file of the pipeline vanished while it was imported")
    python = sys.version.encode()
    return typed_digest("sources", python, _FOLLOWED_BY.encode(), _listing(packages))


def _listing(packages: Iterable[str]) -> bytes:
    lines = [
        f"{name} {file_digest(path)}"
        for package in packages
        for name, path in sorted(package_files(package).items())
    ]
    return "\n".join(lines).encode()


def _kept(path: Path, name: str) -> Closure | None:
    """Returns the closure in a file; None where that is absent, damaged or of another class."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        found = json.loads(path.read_bytes())
        if found["digest"] == _digest(name, found["closure"]):
            return dict(found["closure"])
    return None


def _keep(path: Path, name: str, closure: Closure) -> None:
    """Writes a file at once or not at all, and removes what belongs to other files than these."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for other in path.parent.parent.iterdir():
        if other != path.parent:
            shutil.rmtree(other, ignore_errors=True)
    partial = path.with_suffix(f".{os.getpid()}")
    try:
        partial.write_text(json.dumps({"digest": _digest(name, closure), "closure": closure}))
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _digest(name: str, closure: Closure) -> str:
    return typed_digest("closure", name.encode(), canonical_json(closure))


def _follower() -> str:
    """Returns a digest of the pipeline's files; empty where one vanishes in this moment."""
    with contextlib.suppress(OSError):
        return typed_digest("follower", _listing(["pipeline"]))
    return ""


_FOLLOWED_BY = _follower()
"""The pipeline as this process imported it; its files may change while it runs."""
