"""`python -m` in processes that a server forks, which has imported the libraries of the commands.

An interpreter takes a third of a second to import what Luigi needs, and three seconds for torch and
numba; then its builds would take as long again. Luigi reads settings on import, so each process
imports it itself.
"""

import functools
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import chdir, contextmanager
from pathlib import Path

from pipeline.execution import fork_server
from pipeline.execution.fork_server import ForkServer

ROOT = Path(__file__).parents[2]


class ForkedModule(subprocess.Popen):
    """`python -m` with some words, whose builds the same server forks."""

    def __init__(self, server: ForkServer, words: Sequence[str], **options: object) -> None:
        self._server = server
        super().__init__(words, stdout=subprocess.PIPE, text=True, **options)

    def _execute_child(self, args, *others) -> None:
        cwd, env = others[4:6]
        pipes = others[9:15]
        _, _, output, output_of_child, _, errors_of_child = pipes
        requests, _ = self._server._process
        errors = 2 if errors_of_child == -1 else errors_of_child
        streams = requests.fileno(), output_of_child, errors
        with chdir(cwd):
            self._forked = self._server.start("forked_modules:run", args, env, streams)
        self._child_created = True
        self._close_pipe_fds(*pipes)
        self.pid = int(b"".join(iter(functools.partial(os.read, output, 1), b"\n")))

    def _try_wait(self, wait_flags: int) -> tuple[int, int]:
        """Returns what `os.waitpid` would return for a child of this process."""
        if wait_flags and not select.select([self._forked._statuses], [], [], 0)[0]:
            return 0, 0
        status = self._forked.wait()
        return self.pid, status << 8 if status >= 0 else -status

    def _internal_poll(self, **_options: object) -> int | None:
        if self.returncode is None:
            pid, status = self._try_wait(os.WNOHANG)
            if pid:
                self._handle_exitstatus(status)
        return self.returncode


def run(module: str, *arguments: str) -> None:
    """In the process that was forked: becomes the command. Standard input is the server's."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    server = ForkServer([])
    server.__dict__["_process"] = socket.socket(fileno=os.dup(0)), None
    with Path(os.devnull).open() as nothing:
        os.dup2(nothing.fileno(), 0)
    os.write(1, f"{os.getpid()}\n".encode())
    sys.path[:0] = [str(Path.cwd()), str(ROOT)]
    sys.argv[1:] = arguments
    with forks_of(server):
        runpy.run_module(module, run_name="__main__", alter_sys=True)


@contextmanager
def forks_of(server: ForkServer) -> Iterator[None]:
    """The body's builds are forks of this server, which does not end with it."""
    before = fork_server._of_command.set(server)
    try:
        yield
    finally:
        fork_server._of_command.reset(before)
