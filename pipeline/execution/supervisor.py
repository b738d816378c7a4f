"""Runs one build under supervision, in a process that calls `supervise`.

The supervisor forks before it imports any code of the project. It waits for the builder and checks
its time, its memory, and standard input. The end of standard input means that the command has
ended. In every case, the builder's process group ends with the builder. Both processes report on
standard output, since the disk may be full. Each report is a JSON object with fields of
`pipeline.job.Report`. The output of the build itself goes to standard error, which is the log.
"""

import contextlib
import json
import os
import re
import select
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil

from pipeline.execution.parent_process import die_with

_SECONDS_BETWEEN_POLLS, _SECONDS_BETWEEN_NOTES = 0.1, 0.5
_SPENT = ".seconds"
_MAXRSS_UNIT = 1 if sys.platform == "darwin" else 1024
_CAUSES = {"timeout": "for taking too long", "memory": "for lack of memory"}


def supervise(specification: str) -> int:
    """Forks the builder, supervises it and reports; returns the exit status."""
    job = json.loads(Path(specification).read_text())
    supervisor = os.getpid()
    builder = os.fork()
    if builder == 0:
        os.setpgid(0, 0)
        die_with(supervisor)
        return _build(job)
    with contextlib.suppress(OSError):  # both processes do it, so that neither has to wait
        os.setpgid(builder, builder)
    limits = job["timeout_seconds"], job["memory_limit_bytes"]
    _report(1, **_supervise(builder, *limits, Path(job["resume"])))
    return 0


def _supervise(builder: int, max_seconds: float, max_bytes: int, resume: Path) -> dict[str, Any]:
    """Waits for the builder, and ends its process group at a limit or with the command.

    Memory is the resident memory of all its processes, measured ten times a second. A page that
    two of them share counts twice.
    """
    started, oom_kills, seconds, peak, kind = time.monotonic(), _oom_kills(), 0.0, 0, "killed"
    busy, earlier, noted = _busy_seconds(), _spent(resume), 0.0
    watched = {0, *_end_of(builder)}
    while not (ended := os.wait4(builder, os.WNOHANG))[0]:
        seconds, peak = time.monotonic() - started, max(peak, _resident_bytes(builder))
        if seconds > noted + _SECONDS_BETWEEN_NOTES:
            noted = seconds
            _note_spent(resume, earlier + seconds)
        if max_seconds and seconds > max_seconds:
            kind = "timeout"
        elif max_bytes and peak > max_bytes:
            kind = "memory"
        if kind != "killed" or 0 not in watched:
            _end(builder)
        if 0 in select.select(watched, [], [], _SECONDS_BETWEEN_POLLS)[0]:
            watched.remove(0)  # the command has ended
    seconds = time.monotonic() - started
    _end(builder)  # processes that it started and left behind
    status, largest = os.waitstatus_to_exitcode(ended[1]), ended[2].ru_maxrss * _MAXRSS_UNIT
    own = ended[2].ru_utime + ended[2].ru_stime
    report = {"status": status, "seconds": seconds, "peak_memory_bytes": max(peak, largest)}
    report |= {"earlier_seconds": earlier}
    report |= {"cpu_seconds": own, "other_cpu_seconds": max(0.0, _busy_seconds() - busy - own)}
    if status >= 0:
        return report  # and the builder has reported the rest
    if kind == "killed" and _oom_kills() > oom_kills:
        kind = "memory"
    cause = f"by {signal.Signals(-status).name}" if kind == "killed" else _CAUSES[kind]
    return {**report, "kind": kind, "message": f"ended {cause}"}


def _build(job: dict[str, Any]) -> int:
    """Imports the task, builds it and reports the outcome, in the process of the builder."""
    if job["cpu_affinity"]:
        os.sched_setaffinity(0, job["cpu_affinity"])  # before anything counts the cores
    report, nothing = os.dup(1), os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    from pipeline.execution.builder import run_job
    from pipeline.execution.progress_pipe import ProgressPipe
    from pipeline.job import Job

    kind, message = run_job(Job(**job), ProgressPipe(report))
    _report(report, kind=kind, message=message[:8000])  # the log has all of it
    return 0 if kind == "built" else 1


def _report(descriptor: int, **fields: object) -> None:
    with open(descriptor, "w") as file:
        file.write(f"\n{json.dumps(fields)}\n")  # a killed process may leave half a line before it


def _end_of(process: int) -> list[int]:
    """Returns a descriptor that can be read once a process has ended, where the system has one."""
    with contextlib.suppress(AttributeError, OSError):  # neither on macOS nor on an old Linux
        return [os.pidfd_open(process)]
    return []


def _end(group: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


def _resident_bytes(builder: int) -> int:
    """Returns the memory of the builder's group and of all processes that it started."""
    members, total = set(_descendants(builder)), 0
    for pid in psutil.pids():
        with contextlib.suppress(psutil.Error, OSError):  # it has just ended
            if pid in members or os.getpgid(pid) == builder:
                total += psutil.Process(pid).memory_info().rss
    return total


def _descendants(pid: int) -> Iterator[int]:
    """Yields the descendants of a process from Linux's tree, whatever else runs."""
    with contextlib.suppress(OSError):
        for thread in Path(f"/proc/{pid}/task").iterdir():
            for child in map(int, (thread / "children").read_text().split()):
                yield child
                yield from _descendants(child)


def _spent(resume: Path) -> float:
    """Returns the time of earlier attempts whose checkpoints this one uses."""
    with contextlib.suppress(OSError, ValueError):
        if _checkpoints(resume):
            return float((resume / _SPENT).read_text())
    return 0.0


def _checkpoints(resume: Path) -> list[Path]:
    return [path for path in resume.iterdir() if path.name[0] != "."]


def _note_spent(resume: Path, seconds: float) -> None:
    """Writes the time beside the checkpoints, if there are any, and unless the disk is full."""
    with contextlib.suppress(OSError):
        if _checkpoints(resume):
            (resume / _SPENT).write_text(f"{seconds:.1f}")


def _busy_seconds() -> float:
    """Returns the CPU time of all processes of the machine since it started."""
    times = psutil.cpu_times()
    idle = times.idle + getattr(times, "iowait", 0.0)
    counted_twice = getattr(times, "guest", 0.0) + getattr(times, "guest_nice", 0.0)
    return float(sum(times) - idle - counted_twice)


def _oom_kills() -> int:
    """Returns how many processes the kernel has killed for lack of memory, in any container."""
    counters = Path("/proc/vmstat").read_text() if sys.platform == "linux" else ""
    return sum(map(int, re.findall(r"^oom_kill (\d+)", counters, re.MULTILINE)))
