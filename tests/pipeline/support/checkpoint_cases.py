"""Checkpoints of a build that fails, and what a shared store holds of them."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from pipeline.shared_store.checkpoints import shared_checkpoints
from pipeline.shared_store.settings import current_remote

KEY = "ab" * 32


def folder(path: Path, **files: str) -> Path:
    path.mkdir()
    for name, text in files.items():
        (path / name).write_text(text)
    return path


class LostError(Exception):
    """What a build ends by."""


@contextlib.contextmanager
def failing(resume: Path) -> Iterator[None]:
    """A build that fails when it has done what is within."""
    with contextlib.suppress(LostError), shared_checkpoints(KEY, resume):
        yield
        raise LostError


def uploaded() -> list[str]:
    return current_remote().names(f"resume/{KEY}")
