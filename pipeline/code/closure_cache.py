"""A cache of code closures on disk, which is valid until a file of the project changes.

The search through a task's code parses the whole project, which takes seconds for all families.
Its result depends only on the files, the Python version, the code of the pipeline and the class. So
the cache is in a folder named by a digest of these, beside Python's bytecode, and it has results
for the present files only. A result that is absent, damaged or not writable is computed.
"""

import contextlib
import json
import shutil
import sys
from collections.abc import Callable, Iterable
from importlib.util import cache_from_source
from pathlib import Path

from pipeline.canonical import canonical_json
from pipeline.code.atomic_write import write_atomically
from pipeline.code.source import package_files
from pipeline.digest import file_digest, typed_digest

Closure = dict[str, str]


def cached_closure(
    name: str, packages: Iterable[str], follow: Callable[[], Closure], folder: Path | None = None
) -> Closure:
    """Returns the result of `follow`, from the cache if these packages have not changed.

    Args:
        name: The name of the class, with its module.
        packages: All packages that `follow` may read.
        follow: Computes the closure.
        folder: The folder of the cache; by default beside the bytecode of this file.
    """
    packages = sorted(packages)
    root = folder or Path(cache_from_source(__file__)).parent / "closures"
    try:
        files = sources_digest(packages)
    except OSError:  # a file was deleted, or cannot be read
        return follow()
    path = root / files / f"{typed_digest('closure-name', name.encode())[:16]}.json"
    if (kept := _read(path, name)) is not None:
        return kept
    closure = follow()
    with contextlib.suppress(OSError):
        if sources_digest(packages) == files:  # otherwise the result may be of newer files
            _write(path, name, closure)
    return closure


def sources_digest(packages: Iterable[str]) -> str:
    """Returns a digest of all files of the packages, of the Python version, and of the pipeline.

    Raises:
        OSError: A file was deleted, or cannot be read, now or when this module was imported.
    """
    if not _PIPELINE_DIGEST:
        raise FileNotFoundError("a file of the pipeline was deleted while it was imported")
    python = sys.version.encode()
    return typed_digest("sources", python, _PIPELINE_DIGEST.encode(), _listing(packages))


def _listing(packages: Iterable[str]) -> bytes:
    lines = [
        f"{name} {file_digest(path)}"
        for package in packages
        for name, path in sorted(package_files(package).items())
    ]
    return "\n".join(lines).encode()


def _read(path: Path, name: str) -> Closure | None:
    """Reads the closure in a file; None if it is absent, damaged or of another class."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        found = json.loads(path.read_bytes())
        if found["digest"] == _digest(name, found["closure"]):
            return dict(found["closure"])
    return None


def _write(path: Path, name: str, closure: Closure) -> None:
    """Writes a result, and removes those of earlier files."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for other in path.parent.parent.iterdir():
        if other != path.parent:
            shutil.rmtree(other, ignore_errors=True)
    write_atomically(path, json.dumps({"digest": _digest(name, closure), "closure": closure}))


def _digest(name: str, closure: Closure) -> str:
    return typed_digest("closure", name.encode(), canonical_json(closure))


def pipeline_digest() -> str:
    """Returns a digest of the pipeline's files; empty if a file is deleted at this moment."""
    with contextlib.suppress(OSError):
        return typed_digest("follower", _listing(["pipeline"]))
    return ""


_PIPELINE_DIGEST = pipeline_digest()
"""The digest when this process imported the pipeline, whose files may change later."""
