"""What of a host is lent to one build at a time: its cards, its cores, parts of its memory.

Each unit is a file, and its flock the lease, whatever users and stores the host has. The build's
own processes hold it, so it goes with the last of them, however they end. Like every lock here, it
spares trouble and proves nothing.
"""

import contextlib
import fcntl
import functools
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from pipeline.errors import StoreError
from pipeline.locks import try_lock
from pipeline.settings import setting

_SECONDS_BETWEEN_LOOKS = 0.5


@contextlib.contextmanager
def open_locks(kind: str, names: Sequence[str]) -> Iterator[dict[str, int]]:
    """Open the files of units, by name; what was taken of them is given back afterwards.

    Raises:
        StoreError: When the folder of leases cannot be used.
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
    """Lock units that nobody else has; returns their names, none where fewer than `least` are free.

    It never waits.
    """
    taken: list[str] = []
    for name, file in files.items():
        if len(taken) < most and try_lock(file):
            taken.append(name)
    if len(taken) >= least:
        return taken
    for name in taken:
        fcntl.flock(files[name], fcntl.LOCK_UN)
    return []


def acquire(
    files: Mapping[str, int], least: int, most: int, say_so: Callable[[], object]
) -> list[str]:
    """`try_acquire`, as soon as that many are free; calls `say_so` once where it has to wait."""
    say_once = functools.cache(say_so)
    while not (taken := try_acquire(files, least, most)):
        say_once()
        time.sleep(_SECONDS_BETWEEN_LOOKS)
    return taken


@contextlib.contextmanager
def fifo_queue(say_so: Callable[[], object]) -> Iterator[None]:
    """Choose what to take while nobody else does, in the order of asking."""
    with open_locks("turn", ["0"]) as files:
        if not try_lock(files["0"]):
            say_so()
            fcntl.flock(files["0"], fcntl.LOCK_EX)
        yield


def _lease_folder() -> Path:
    """The folder of the units' files, made where there is none, for all users of the host."""
    folder = Path(setting("host", "leases"))
    umask = os.umask(0)
    try:
        folder.mkdir(mode=0o1777, exist_ok=True)
    finally:
        os.umask(umask)
    return folder


def _open(name: str) -> int:
    """The unit's file, which another user may have made; ours can be opened by others."""
    umask = os.umask(0)
    try:
        path = _lease_folder() / name
        with contextlib.suppress(FileExistsError):
            path.touch(0o644, exist_ok=False)
        return os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
    except OSError as error:
        remedy = "Name a folder that all users of this host can write to in [host] leases."
        raise StoreError(f"{name} cannot be leased: {error}. {remedy}") from error
    finally:
        os.umask(umask)
