"""SHA-256 over typed parts, and over directories."""

import hashlib
import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.canonical import canonical_json


@dataclass(frozen=True, slots=True)
class Tree:
    """The content of a directory.

    Attributes:
        digest: 64 hexadecimal digits over the names, sizes and bytes of all its files.
        size: The bytes in its files.
        files: The number of its files.
    """

    digest: str
    size: int
    files: int


def typed_digest(kind: str, *parts: bytes) -> str:
    """Returns the SHA-256 of `parts`, each after its length, in the name space `kind`.

    Different sequences of parts, and different kinds, never hash the same bytes.
    """
    hasher = hashlib.sha256()
    for part in (kind.encode(), *parts):
        hasher.update(len(part).to_bytes(8, "big"))
        hasher.update(part)
    return hasher.hexdigest()


def file_digest(path: Path) -> str:
    """Returns the SHA-256 of the bytes of one file."""
    with path.open("rb", buffering=0) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def tree_digest(root: Path) -> Tree:
    """Returns the content of a directory: names, sizes and bytes, but no times, owners or modes.

    Raises:
        ValueError: The directory contains a symbolic link, a device, a socket or a pipe.
    """
    listing: list[tuple[str, int, str]] = []
    size = files = 0
    for path, status in entries_below(root):
        name = path.relative_to(root).as_posix()
        if stat.S_ISDIR(status.st_mode):
            listing.append((f"{name}/", 0, ""))
            continue
        listing.append((name, status.st_size, file_digest(path)))
        size, files = size + status.st_size, files + 1
    return Tree(typed_digest("pipeline-tree-v1", canonical_json(listing)), size, files)


def is_tree(root: Path, tree: Tree) -> bool:
    """Whether the directory `root` exists and has exactly this content; reads every byte."""
    try:
        return tree_digest(root) == tree
    except (OSError, ValueError):
        return False


def measure(root: Path) -> tuple[int, int]:
    """Returns the bytes and the number of the files below `root`, without reading them."""
    sizes = [status.st_size for _, status in entries_below(root) if stat.S_ISREG(status.st_mode)]
    return sum(sizes), len(sizes)


def entries_below(root: Path) -> Iterator[tuple[Path, os.stat_result]]:
    """Yields every file and directory below `root`, parents first, in the order of their names.

    Raises:
        ValueError: There is anything other than regular files and directories.
    """
    with os.scandir(root) as entries:
        ordered = sorted(entries, key=lambda entry: entry.name)
    for entry in ordered:
        status, path = entry.stat(follow_symlinks=False), Path(entry.path)
        if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
            raise ValueError(f"{path} is neither a file nor a directory")
        yield path, status
        if stat.S_ISDIR(status.st_mode):
            yield from entries_below(path)
