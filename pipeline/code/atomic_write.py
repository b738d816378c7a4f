"""Replaces a file while other processes may read it."""

import os
from pathlib import Path


def write_atomically(path: Path, text: str) -> None:
    """Replaces the text of a file. Other processes read the former text or this one, never a part.

    Raises:
        OSError: The disk fails or is full. The former text stays.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        partial.write_text(text)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
