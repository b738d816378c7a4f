"""Closures of code on disk, for as long as no file of the project changes.

Following a task's code means parsing all of the project, which takes two seconds for all families.
What it finds depends on nothing but the files, the Python that parses them, and the class. So it is
kept below a digest of these, where Python keeps bytecode, and only for the files as they are now.
What is absent or damaged there, or cannot be written, is computed.
"""

import contextlib
import json
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable
from importlib.util import cache_from_source
from pathlib import Path

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
    files = sources_digest(packages)
    path = root / files / f"{typed_digest('closure-name', name.encode())[:16]}.json"
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        kept = json.loads(path.read_bytes())
        if kept["name"] == name:
            return dict(kept["closure"])
    closure = follow()
    if sources_digest(packages) == files:  # else it may be of newer files
        with contextlib.suppress(OSError):
            _keep(path, json.dumps({"name": name, "closure": closure}))
    return closure


def sources_digest(packages: Iterable[str]) -> str:
    """Returns a digest of all files of the packages, by name, and of the Python that reads them."""
    listing = [
        f"{package} {name} {file_digest(path)}"
        for package in packages
        for name, path in sorted(package_files(package).items())
    ]
    return typed_digest("sources", sys.version.encode(), "\n".join(listing).encode())


def _keep(path: Path, text: str) -> None:
    """Writes a file at once or not at all, and removes what belongs to other files than these."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for other in path.parent.parent.iterdir():
        if other != path.parent:
            shutil.rmtree(other, ignore_errors=True)
    with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False) as file:
        file.write(text)
    Path(file.name).replace(path)
