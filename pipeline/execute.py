"""`python -m pipeline.execute JOB.json TERMINAL`: one build, supervised.

The supervisor forks before anything heavy is imported and stays tiny. It waits for the builder,
and for the end of its own standard input, which means that whoever wanted the build is gone.
Either way the builder's process group ends. Builder and supervisor report on standard output, a
JSON object each (a disk may be full); what the build itself prints goes to standard error, the log.
"""

import contextlib
import ctypes
import json
import os
import signal
import sys
import threading
import time
from pathlib import Path

_PR_SET_PDEATHSIG = 1


def main() -> int:
    """Fork, supervise, report; returns the exit status."""
    specification, terminal = Path(sys.argv[1]), int(sys.argv[2])
    supervisor, started = os.getpid(), time.monotonic()
    builder = os.fork()
    if builder == 0:
        _die_with(supervisor)
        return _build(specification, terminal)
    with contextlib.suppress(OSError):  # both sides do it, so that neither has to wait
        os.setpgid(builder, builder)
    threading.Thread(target=_end_with_lifeline, args=(builder,), daemon=True).start()
    _, waited, usage = os.wait4(builder, 0)
    _end(builder)  # what it started and left behind
    _say(
        1,
        status=os.waitstatus_to_exitcode(waited),
        seconds=time.monotonic() - started,
        peak_memory_bytes=usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024),
    )
    return 0


def _build(specification: Path, terminal: int) -> int:
    """In the builder: import the task, build, say why it failed."""
    report, nothing = os.dup(1), os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    from pipeline.execution import Job, perform

    job = Job(**json.loads(specification.read_text()))
    with open(terminal, "w") as screen:
        status, message = perform(job, screen)
    _say(report, message=message[:8000])  # the pipe holds as much unread
    return status


def _say(descriptor: int, **fields: object) -> None:
    with open(descriptor, "w") as file:
        file.write(json.dumps(fields) + "\n")


def _die_with(supervisor: int) -> None:
    """In the builder: a group of our own, and the kernel kills us when the supervisor dies."""
    os.setpgid(0, 0)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != supervisor:
        os.kill(os.getpid(), signal.SIGKILL)


def _end_with_lifeline(builder: int) -> None:
    os.read(0, 1)
    _end(builder)


def _end(group: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


if __name__ == "__main__":
    sys.exit(main())
