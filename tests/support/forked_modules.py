"""`python -m` in processes that a server forks, which has imported the libraries of the commands.

An interpreter takes a third of a second to import what Luigi needs, and three seconds for torch and
numba; then its builds would take as long again. Luigi reads settings on import, so each process
imports it itself.
"""

import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import chdir
from pathlib import Path
from threading import Thread
from typing import IO

from pipeline.execution.fork_server import ForkServer, forked_by

ROOT = Path(__file__).parents[2]


class ForkedModule:
    """`python -m` with some words, whose builds the same server forks.

    It has the attributes and methods of `subprocess.Popen` that tests need, with `text=True`.
    """

    def __init__(
        self,
        server: ForkServer,
        words: Sequence[str],
        cwd: Path,
        env: Mapping[str, str],
        stderr: int | None,
    ) -> None:
        self.args, self.returncode = words, None
        output, output_of_child = os.pipe()
        errors, errors_of_child = _errors(stderr)
        streams = server.requests.fileno(), output_of_child, errors_of_child
        with chdir(cwd):
            self._forked = server.start("forked_modules:run", words, env, streams)
        os.close(output_of_child)
        os.close(errors_of_child)
        self.stdout = os.fdopen(output)
        self.stderr = None if errors is None else os.fdopen(errors)
        self.pid = int(self.stdout.readline())

    def poll(self) -> int | None:
        """Returns the exit status if the process has ended."""
        return self._ended(0.0)

    def wait(self, timeout: float | None = None) -> int:
        """Returns the exit status when the process has ended."""
        status = self._ended(timeout)
        if status is None:
            raise subprocess.TimeoutExpired(self.args, timeout)
        return status

    def _ended(self, timeout: float | None) -> int | None:
        if self.returncode is None and select.select([self._forked.statuses], [], [], timeout)[0]:
            self.returncode = self._forked.wait()
        return self.returncode

    def communicate(self, timeout: float | None = None) -> tuple[str, str | None]:
        """Returns what the process writes until it ends."""
        readers = _Reader(self.stdout), _Reader(self.stderr)
        deadline = None if timeout is None else time.monotonic() + timeout
        for reader in readers:
            reader.join(None if deadline is None else max(0.0, deadline - time.monotonic()))
            if reader.is_alive():
                raise subprocess.TimeoutExpired(self.args, timeout)
        self.wait(None if deadline is None else max(0.0, deadline - time.monotonic()))
        output, errors = (reader.text for reader in readers)
        return output or "", errors

    def send_signal(self, number: int) -> None:
        """Sends a signal, unless the process has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Ends the process."""
        self.send_signal(signal.SIGKILL)


class _Reader(Thread):
    """Reads a stream to its end."""

    def __init__(self, stream: IO[str] | None) -> None:
        super().__init__(daemon=True)
        self._stream, self.text = stream, None
        self.start()

    def run(self) -> None:
        if self._stream:
            with self._stream:
                self.text = self._stream.read()


def _errors(stderr: int | None) -> tuple[int | None, int]:
    """Returns the descriptor to read standard error from, if any, and that of the process."""
    if stderr == subprocess.PIPE:
        return os.pipe()
    if stderr == subprocess.DEVNULL:
        return None, os.open(os.devnull, os.O_WRONLY)
    return None, os.dup(2 if stderr is None else stderr)


def run(module: str, *arguments: str) -> None:
    """In the process that was forked: becomes the command. Standard input is the server's."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    server = ForkServer([])
    server.requests = socket.socket(fileno=os.dup(0))
    with Path(os.devnull).open() as nothing:
        os.dup2(nothing.fileno(), 0)
    os.write(1, f"{os.getpid()}\n".encode())
    sys.path[:0] = [str(Path.cwd()), str(ROOT)]
    sys.argv[1:] = arguments
    with forked_by(server):
        runpy.run_module(module, run_name="__main__", alter_sys=True)
