"""The server of a command, which has imported the libraries and forks its builds and validation.

Torch, numba and OpenCV take two seconds to import, as long as many stages take. A fork takes
milliseconds. The process of the server is in `pipeline.execution.forking_process`.
"""

import contextlib
import errno
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import IO, final

from pipeline.code.interpreters import interpreter_command
from pipeline.execution.environment import build_environment
from pipeline.execution.forking_process import FORKED, LARGEST_REQUEST_BYTES

_of_command: ContextVar["ForkServer | None"] = ContextVar("fork_server", default=None)


@final
class ForkServer:
    """The server as a command sees it. Its process starts with the first fork."""

    def __init__(self, libraries: Sequence[str]) -> None:
        self._libraries = libraries
        self._process: subprocess.Popen[bytes] | None = None

    @cached_property
    def requests(self) -> socket.socket:
        """The socket that takes requests; another server's may be assigned before the first one."""
        command = [sys.executable, "-P", "-m", "pipeline.execution.forking_process"]
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [*command, *self._libraries],
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=build_environment(),
                start_new_session=True,
            )
        return ours

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
        if len(message := request.encode()) > LARGEST_REQUEST_BYTES:
            raise OSError(errno.EMSGSIZE, os.strerror(errno.EMSGSIZE))
        reading, writing = os.pipe()
        try:
            socket.send_fds(self.requests, [message], [writing, *streams, *kept])
        except OSError:
            os.close(reading)
            raise
        finally:
            os.close(writing)
        statuses = os.fdopen(reading)
        if statuses.readline() != FORKED:
            statuses.close()
            raise OSError(errno.ECHILD, os.strerror(errno.ECHILD))
        return ForkedProcess(statuses)

    def close(self) -> None:
        """Ends the server, if it was started.

        It has nothing to save, and ends by itself when requests end: libraries that it has loaded
        may catch other signals, and wait for ever in their handlers for locks of that end.
        """
        if self._process:
            self.requests.close()
            self._process.kill()
            self._process.wait()


@final
@dataclass(frozen=True, slots=True)
class ForkedProcess:
    """A process that the server forked, with the method of `subprocess.Popen` that is needed.

    Attributes:
        statuses: The server writes the exit status here when the process has ended.
    """

    statuses: IO[str]

    def wait(self) -> int:
        """Waits for the end; returns the exit status, or minus the signal that ended it."""
        with self.statuses as file:
            return int(file.read() or -signal.SIGKILL)  # nothing, if the server was killed


@contextlib.contextmanager
def fork_server(libraries: Sequence[str]) -> Iterator[None]:
    """Provides a process that has imported the libraries and forks the builds of this context.

    Within the context of another server, that server forks the builds. Otherwise each build starts
    an interpreter where there are no libraries, and on systems other than Linux, where forks of
    large libraries are not safe.
    """
    if not libraries or sys.platform != "linux" or current_fork_server():
        yield
        return
    server = ForkServer(libraries)
    try:
        with forked_by(server):
            yield
    finally:
        server.close()


@contextlib.contextmanager
def forked_by(server: ForkServer) -> Iterator[None]:
    """Lets a server fork the builds of this context; it does not end with the context."""
    before = _of_command.set(server)
    try:
        yield
    finally:
        _of_command.reset(before)


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
