"""Leases of a host's resources: GPUs, cores and parts of the memory, each for one build at a time.

Each unit is a file, and an flock on it is the lease, for all users and stores of the host. The
processes of the build hold the lock, so it ends with the last of them. No result depends on these
locks. Without them, builds would only slow each other down.
"""

import contextlib
import fcntl
import functools
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from pipeline.errors import StoreError
from pipeline.locks import try_lock
from pipeline.settings import setting

LEASES = "STYLETRF_LEASES"
"""The variable for the folder of leases of this host."""
_SECONDS_BETWEEN_POLLS = 0.5


@contextlib.contextmanager
def open_locks(kind: str, names: Sequence[str]) -> Iterator[dict[str, int]]:
    """Opens the files of units, by name. When they are closed, the leases end.

    Raises:
        StoreError: The folder of leases cannot be used.
    """
    files: dict[str, int] = {}
    try:
        for name in names:
            files[name] = _open(f"{kind}-{name}")
        yield files
    finally:
        for file in files.values():
            os.close(file)


def try_acquire(files: Mapping[str, int], least: int, most: int) -> list[str]:
    """Locks free units, without waiting, and returns their names; none if too few are free.

    Args:
        files: The files of the units.
        least: How many units are needed.
        most: How many units are taken at most.
    """
    taken: list[str] = []
    for name, file in files.items():
        if len(taken) < most and try_lock(file) is not False:
            taken.append(name)
    if len(taken) >= least:
        return taken
    release(files, taken)
    return []


def release(files: Mapping[str, int], names: Iterable[str]) -> None:
    """Unlocks units of this process."""
    for name in names:
        with contextlib.suppress(OSError):  # a file system without flock
            fcntl.flock(files[name], fcntl.LOCK_UN)


def acquire(
    files: Mapping[str, int], least: int, most: int, on_wait: Callable[[], object]
) -> list[str]:
    """Waits for `try_acquire`, and returns its names; calls `on_wait` once if it has to wait."""
    notify_once = functools.cache(on_wait)
    while not (taken := try_acquire(files, least, most)):
        notify_once()
        time.sleep(_SECONDS_BETWEEN_POLLS)
    return taken


@contextlib.contextmanager
def fifo_queue(on_wait: Callable[[], object]) -> Iterator[None]:
    """Lets one process at a time choose its units, in the order of their requests."""
    with open_locks("turn", ["0"]) as files:
        if try_lock(files["0"]) is False:
            on_wait()
            fcntl.flock(files["0"], fcntl.LOCK_EX)
        yield


def _open(name: str) -> int:
    """Opens the file of a unit. Another user may have made it, and all users may open it."""
    umask = os.umask(0)
    try:
        folder = Path(os.environ.get(LEASES) or setting("host", "leases"))
        folder.mkdir(mode=0o1777, exist_ok=True)
        path = folder / name
        with contextlib.suppress(FileExistsError):
            path.touch(0o644, exist_ok=False)
        return os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
    except OSError as error:
        remedy = "Name a folder that all users of this host can write to in [host] leases."
        raise StoreError(f"{name} cannot be leased: {error}. {remedy}") from error
    finally:
        os.umask(umask)
