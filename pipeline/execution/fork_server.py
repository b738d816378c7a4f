"""A process that has imported the libraries, and forks the builds and the validation of a command.

Torch, numba and OpenCV take two seconds to import, as long as many stages take. A fork takes
milliseconds. The server imports libraries, and of the project only the imports of this file, so
that a build imports the present code of the stages. It computes nothing, so it has no threads.
"""

import contextlib
import errno
import gc
import importlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextvars import ContextVar
from functools import cached_property
from pathlib import Path
from typing import IO, Any, final

from pipeline.code.interpreters import interpreter_command
from pipeline.execution.environment import build_environment

_LARGEST_REQUEST_BYTES = 2**17
_MOST_DESCRIPTORS = 253  # the limit of Linux
_FORKED = "forked\n"
"""The line that a command reads before the status, when its process has started."""
_of_command: ContextVar["ForkServer | None"] = ContextVar("fork_server", default=None)


@final
class ForkServer:
    """The server as a command sees it. Its process starts with the first fork."""

    def __init__(self, libraries: Sequence[str]) -> None:
        self._libraries = libraries

    @cached_property
    def _process(self) -> "tuple[socket.socket, subprocess.Popen[bytes]]":
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            process = subprocess.Popen(
                [sys.executable, "-P", "-m", "pipeline.execution.fork_server", *self._libraries],
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=build_environment(),
                start_new_session=True,
            )
        return ours, process

    def start(
        self,
        function: str,
        arguments: Sequence[str],
        environment: Mapping[str, str],
        streams: tuple[int, int, int],
        kept: Sequence[int] = (),
    ) -> "ForkedProcess":
        """Forks a process.

        Args:
            function: The function to call, as `module:name`. It returns the exit status.
            arguments: The arguments of the function.
            environment: All variables of the process.
            streams: Its standard input, output and error.
            kept: Other descriptors that it holds open.

        Raises:
            OSError: The server has ended or cannot fork, or the request is too large.
        """
        path = [*filter(None, sys.path)]
        request = json.dumps([function, [*arguments], dict(environment), path, str(Path.cwd())])
        if len(message := request.encode()) > _LARGEST_REQUEST_BYTES:
            raise OSError(errno.EMSGSIZE, os.strerror(errno.EMSGSIZE))
        reading, writing = os.pipe()
        try:
            socket.send_fds(self._process[0], [message], [writing, *streams, *kept])
        except OSError:
            os.close(reading)
            raise
        finally:
            os.close(writing)
        statuses = os.fdopen(reading)
        if statuses.readline() != _FORKED:
            statuses.close()
            raise OSError(errno.ECHILD, os.strerror(errno.ECHILD))
        return ForkedProcess(statuses)

    def close(self) -> None:
        """Ends the server, if it was started."""
        if "_process" in self.__dict__:
            requests, process = self._process
            requests.close()
            process.terminate()
            process.wait()


@final
class ForkedProcess:
    """A process that the server forked, with the method of `subprocess.Popen` that is needed."""

    def __init__(self, statuses: IO[str]) -> None:
        self._statuses = statuses

    def wait(self) -> int:
        """Waits for the end; returns the exit status, or minus the signal that ended it."""
        with self._statuses as file:
            return int(file.read() or -signal.SIGKILL)  # nothing, if the server was killed


@contextlib.contextmanager
def fork_server(libraries: Sequence[str]) -> Iterator[None]:
    """Provides a process that has imported the libraries and forks the builds of this context.

    Without libraries each build starts an interpreter. So it does on systems other than Linux,
    where forks of large libraries are not safe.
    """
    if not libraries or sys.platform != "linux":
        yield
        return
    server = ForkServer(libraries)
    before = _of_command.set(server)
    try:
        yield
    finally:
        _of_command.reset(before)
        server.close()


def current_fork_server() -> ForkServer | None:
    """Returns the server of this context, if there is one."""
    return _of_command.get()


def output_of(function: str, text: str) -> str:
    """Runs a function with a text on standard input; returns its standard output.

    The server of this context forks the process. Without a server it is a new interpreter.

    Args:
        function: The function to call, as `module:name`. It returns the exit status.
        text: What it reads.

    Raises:
        RuntimeError: The process was killed, or the function failed.
    """
    (stdin, to_process), (from_process, stdout) = os.pipe(), os.pipe()
    with os.fdopen(to_process, "w") as written, os.fdopen(from_process) as read:
        try:
            process = start_process(
                function, (), build_environment(), (stdin, stdout, 2), own_session=False
            )
        finally:
            os.close(stdin)
            os.close(stdout)
        with contextlib.suppress(BrokenPipeError):
            written.write(text)
            written.close()
        output = read.read()
        if status := process.wait():
            ended = f"failed with status {status}" if status > 0 else "was killed"
            raise RuntimeError(f"{function} {ended} before it answered")
    return output


def start_process(
    function: str,
    arguments: Sequence[str],
    environment: Mapping[str, str],
    streams: tuple[int, int, int],
    kept: Sequence[int] = (),
    *,
    is_forked: bool = True,
    own_session: bool = True,
) -> "ForkedProcess | subprocess.Popen[bytes]":
    """Starts a process: a fork of the server of this context, or else a new interpreter.

    The arguments are those of `ForkServer.start`. Unless `is_forked`, it is an interpreter.
    An interpreter without a session of its own ends with the command at Ctrl-C.
    """
    if is_forked and (server := current_fork_server()):
        with contextlib.suppress(OSError):  # the server was killed, or cannot fork
            return server.start(function, arguments, environment, streams, kept)
    stdin, stdout, stderr = streams
    return subprocess.Popen(
        [*interpreter_command(function), *arguments],
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        pass_fds=kept,
        env=environment,
        start_new_session=own_session,
    )


def main() -> int:
    """Serves until the command ends. A child calls its function instead."""
    for name in sys.argv[1:]:
        with contextlib.suppress(Exception):  # the build that needs the library reports it
            importlib.import_module(name)
    gc.freeze()  # a collection in a child copies no memory
    request = _child_of(socket.socket(fileno=os.dup(0)))
    return 0 if request is None else _call(*request)


def _child_of(requests: socket.socket) -> tuple[list[Any], list[int]] | None:
    """Forks a child for each request.

    Returns:
        In a child: its request and its descriptors. In the server, when the command has ended:
        None.
    """
    woken, waking = os.pipe()
    os.set_blocking(waking, False)
    signal.set_wakeup_fd(waking)
    signal.signal(signal.SIGCHLD, lambda _signal, _frame: None)
    statuses: dict[int, int] = {}
    while True:
        ready, _, _ = select.select([requests.fileno(), woken], [], [])
        if woken in ready:
            os.read(woken, 4096)
            _send_statuses(statuses)
        if requests.fileno() not in ready:
            continue
        message, (status, *descriptors), _, _ = _receive(requests)
        if not message:
            return None
        try:
            pid = os.fork()
        except OSError:  # the command starts an interpreter instead
            for descriptor in (status, *descriptors):
                os.close(descriptor)
            continue
        if pid == 0:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            for descriptor in (requests.detach(), woken, waking, status, *statuses.values()):
                os.close(descriptor)
            return json.loads(message), descriptors
        statuses[pid] = status
        with contextlib.suppress(BrokenPipeError):
            os.write(status, _FORKED.encode())
        for descriptor in descriptors:
            os.close(descriptor)


def _receive(requests: socket.socket) -> tuple[bytes, list[int], int, Any]:
    received = socket.recv_fds(requests, _LARGEST_REQUEST_BYTES, _MOST_DESCRIPTORS)
    return received if received[0] else (b"", [-1], 0, None)


def _send_statuses(statuses: dict[int, int]) -> None:
    """Sends the status of each child that has ended."""
    for pid in list(statuses):
        ended, status = os.waitpid(pid, os.WNOHANG)
        if ended:
            with os.fdopen(statuses.pop(pid), "w") as file, contextlib.suppress(BrokenPipeError):
                file.write(str(os.waitstatus_to_exitcode(status)))


def _call(request: list[Any], descriptors: list[int]) -> int:
    """Turns a child into a new interpreter for the request, and calls its function."""
    function, arguments, environment, path, folder = request
    os.setsid()
    os.chdir(folder)
    for number, descriptor in enumerate(descriptors[:3]):
        os.dup2(descriptor, number)
        os.close(descriptor)
    os.environ.clear()
    os.environ.update(environment)
    sys.path[:] = path
    module, _, name = function.partition(":")
    return int(getattr(importlib.import_module(module), name)(*arguments))


if __name__ == "__main__":
    sys.exit(main())
