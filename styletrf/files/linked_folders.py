"""Walks through folders as users keep them, where links lead to other folders."""

import os
from collections import deque
from collections.abc import Iterator
from pathlib import Path


def walk(top: Path) -> Iterator[tuple[Path, list[str], list[str]]]:
    """Yields as `os.walk` does, and enters links to folders as well.

    Each folder is entered once, so that a loop of links ends. One that lies below `top` by itself
    has its own path; folders behind links follow.
    """
    entered, starts = set[Path](), deque([top])
    while starts:
        for parent, folders, files in os.walk(starts.popleft()):
            place = Path(parent)
            if (real := place.resolve()) in entered:
                folders.clear()
                continue
            entered.add(real)
            yield place, folders, files
            starts += [place / name for name in sorted(folders) if (place / name).is_symlink()]


def walk_files(top: Path) -> Iterator[Path]:
    """Yields the entries of all folders of `walk` that are no folders."""
    return (place / name for place, _, names in walk(top) for name in names)
