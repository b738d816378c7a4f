"""Runs: what each process that uses the store resolved there. A lease first, then history.

`runs/UTC-HOST-PID.keys` holds a key a line, and is flocked while its process, or a worker forked
from it, lives. A collection holds `gc.lock` exclusively; whoever takes a lease, or publishes, holds
it shared meanwhile, so that none is overlooked.
"""

import contextlib
import os
import socket
from collections.abc import Iterator, Set
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeAlias

from pipeline.locks import is_held, locked, try_lock

Holders: TypeAlias = list[tuple[Path, Set[str]]]
"""Files that keep something, each with the keys and digests it keeps."""


class Run:
    """This process's run on the store in `root`; its file begins with the first key."""

    def __init__(self, root: Path) -> None:
        self._root, self._keys, self._descriptor = root, set[str](), -1

    @contextlib.contextmanager
    def taking(self, key: str) -> Iterator[None]:
        """Hold off collections; what the key stands for stays while this process lives.

        A store that can only be read, or a full disk, goes without: there the collection's grace
        period protects what is in use.
        """
        with contextlib.ExitStack() as stack:
            with contextlib.suppress(OSError):
                stack.enter_context(locked(self._root / "gc.lock", shared=True))
                self._note(key)
            yield

    def _note(self, key: str) -> None:
        if self._descriptor < 0:
            self._descriptor = self._begin()
        if key not in self._keys:
            os.write(self._descriptor, f"{key}\n".encode())
            self._keys.add(key)

    def _begin(self) -> int:
        name = f"{datetime.now(UTC):%Y%m%dT%H%M%S.%fZ}-{socket.gethostname()}-{os.getpid()}.keys"
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_EXCL
        descriptor = os.open(self._root / "runs" / name, flags, 0o666)
        try_lock(descriptor)
        return descriptor


def runs(root: Path) -> tuple[Holders, Holders]:
    """The runs of living processes, and the finished ones, oldest first: file and keys of each.

    Only for whoever holds `gc.lock` exclusively.
    """
    living, past = Holders(), Holders()
    for path in sorted((root / "runs").glob("*.keys")):
        lines = path.read_text("ascii", "replace").splitlines()
        keys = {line[-64:] for line in lines}  # a full disk may have cut the line before
        (living if is_held(path) else past).append((path, keys))
    return living, past
