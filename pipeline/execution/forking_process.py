"""The process of a fork server: it imports libraries, and forks a child for each request.

Of the project it imports only this file, so that a build imports the present code of the stages. It
computes nothing, so it has no threads. `pipeline.execution.fork_server` starts it and sends the
requests.
"""

import contextlib
import gc
import importlib
import json
import os
import select
import signal
import socket
import sys
from typing import Any

LARGEST_REQUEST_BYTES = 2**17
FORKED = "forked\n"
"""The line that a command reads before the status, when its process has started."""
_MOST_DESCRIPTORS = 253  # the limit of Linux


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
            os.write(status, FORKED.encode())
        for descriptor in descriptors:
            os.close(descriptor)


def _receive(requests: socket.socket) -> tuple[bytes, list[int], int, Any]:
    received = socket.recv_fds(requests, LARGEST_REQUEST_BYTES, _MOST_DESCRIPTORS)
    return received if received[0] else (b"", [-1], 0, None)


def _send_statuses(statuses: dict[int, int]) -> None:
    """Sends the status of each child that has ended."""
    for pid in list(statuses):
        ended, status = os.waitpid(pid, os.WNOHANG)
        if ended:
            with contextlib.suppress(BrokenPipeError), os.fdopen(statuses.pop(pid), "w") as file:
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
