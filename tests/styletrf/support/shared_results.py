"""What many tests need and takes seconds, made once in a run: also where workers share it."""

import fcntl
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

_folders: list[Path] = []


def share_in(folder: Path) -> None:
    """Sets the folder that all workers of a run share."""
    _folders[:] = [folder]


def made_once(name: str, make: Callable[[], Any]) -> Any:
    """Returns what `make` returns in the worker that asks first; without a folder, in each."""
    if not _folders:
        return make()
    file = _folders[0] / f"{name}.pickle"
    with file.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not file.exists():
            part = file.with_suffix(".part")
            part.write_bytes(pickle.dumps(make(), protocol=5))
            part.replace(file)
    return pickle.loads(file.read_bytes())
