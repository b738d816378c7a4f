"""Locks that save work. Correctness rests on publishing without replacing, never on these."""

import contextlib
import errno
import fcntl
import os
from collections.abc import Callable, Iterator
from pathlib import Path

# EBADF: NFS locks no directory for writing, since none can be opened for writing.
_UNSUPPORTED = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EBADF)


@contextlib.contextmanager
def locked(
    path: Path, on_wait: Callable[[], None] = lambda: None, *, shared: bool = False
) -> Iterator[None]:
    """Hold the flock of the file `path`; call `on_wait` first where another holds it.

    The kernel releases the lock when its holder dies, however it dies. The file stays: unlinking
    it would give a waiter a lock on nothing. A file system without flock goes unlocked.
    """
    mode = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
    reads = shared or (path.exists() and not os.access(path, os.W_OK))
    descriptor = os.open(path, os.O_CREAT | (os.O_RDONLY if reads else os.O_RDWR), 0o666)
    try:
        if _flock(descriptor, mode) is False:
            on_wait()
            fcntl.flock(descriptor, mode)
        yield
    finally:
        os.close(descriptor)


def try_lock(descriptor: int) -> bool:
    """Take the flock of an open file or directory without waiting; False where another has it."""
    return _flock(descriptor, fcntl.LOCK_EX) is not False


def is_held(path: Path) -> bool | None:
    """Whether a living process holds the flock of `path`; None where it cannot be told."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        return False
    try:
        taken = _flock(descriptor, fcntl.LOCK_SH)
        return None if taken is None else not taken
    finally:
        os.close(descriptor)


def _flock(descriptor: int, mode: int) -> bool | None:
    """Whether the lock was to be had at once; None on a file system without flock."""
    try:
        fcntl.flock(descriptor, mode | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in _UNSUPPORTED:
            raise
        return None
    return True
