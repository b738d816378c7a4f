"""Locks on files, which save work and show what a living process uses.

Correctness depends on publication without replacement, never on a lock. The kernel releases a lock
when its process ends, for any reason.
"""

import contextlib
import errno
import fcntl
import os
import socket
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

# EBADF: NFS cannot lock a directory for writing, since nobody can open one for writing.
_UNSUPPORTED = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EBADF)


@contextlib.contextmanager
def locked(
    path: Path, on_wait: Callable[[], None] = lambda: None, *, shared: bool = False
) -> Iterator[None]:
    """Holds the flock of the file `path`; calls `on_wait` first if another process holds it.

    The file stays, since a waiting process would otherwise lock a deleted file. On a file system
    without flock there is no lock.
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


def try_lock(descriptor: int) -> bool | None:
    """Takes the flock of an open file or directory, if no other process has it.

    Returns:
        Whether this process has the lock now; None on a file system without flock.
    """
    return _flock(descriptor, fcntl.LOCK_EX)


def is_held(path: Path) -> bool | None:
    """Whether a living process holds the flock of `path`; None where this cannot be known."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        return False
    except PermissionError:
        return None
    try:
        taken = _flock(descriptor, fcntl.LOCK_SH)
        return None if taken is None else not taken
    finally:
        os.close(descriptor)


def _flock(descriptor: int, mode: int) -> bool | None:
    """Whether the lock was free; None on a file system without flock."""
    try:
        fcntl.flock(descriptor, mode | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in _UNSUPPORTED:
            raise
        return None
    return True


class Run:
    """The keys that this process uses in the store at `root`: a lease at first, history later.

    `runs/UTC-HOST-PID.keys` has one key on each line. It is created with the first key. The process
    and its forked workers hold its flock while they live. A garbage collection holds `gc.lock`
    exclusively. A process that leases or publishes a key shares `gc.lock` during this time.
    """

    def __init__(self, root: Path) -> None:
        self._root, self._keys, self._descriptor = root, set[str](), -1

    @contextlib.contextmanager
    def lease(self, key: str) -> Iterator[None]:
        """Delays collections, and keeps the artifacts of the key while this process lives.

        A store that is read-only or on a full disk has no leases. There the grace period of the
        collection protects the artifacts in use.
        """
        with contextlib.ExitStack() as stack:
            with contextlib.suppress(OSError):
                stack.enter_context(locked(self._root / "gc.lock", shared=True))
                self._write(key)
            yield

    def _write(self, key: str) -> None:
        if self._descriptor < 0:
            name = f"{datetime.now(UTC):%Y%m%dT%H%M%S.%fZ}-{socket.gethostname()}-{os.getpid()}"
            flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_EXCL
            self._descriptor = os.open(self._root / "runs" / f"{name}.keys", flags, 0o666)
            try_lock(self._descriptor)
        if key not in self._keys:
            os.write(self._descriptor, f"{key}\n".encode())
            self._keys.add(key)
