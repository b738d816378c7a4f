"""Runs one build: in this process (`inline`, for tests) or in another one (`subprocess`)."""

import dataclasses
import json
import os
import resource
import subprocess
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pipeline.execution.builder import run_job
from pipeline.execution.cpu_memory import THREADS
from pipeline.execution.environment import build_environment
from pipeline.execution.fork_server import ForkedProcess, start_process
from pipeline.execution.progress_pipe import read_messages
from pipeline.job import Display, Job, Report


def build_inline(job: Job, display: Display) -> Report:
    """Builds in this interpreter, without limits: for tests and debuggers."""
    started = time.monotonic()
    kind, message = run_job(job, display)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return Report(kind, message, kind != "built", time.monotonic() - started, peak)


def build_in_subprocess(job: Job, display: Display) -> Report:
    """Builds in another process, which ends with the call, and so do all that it starts.

    Its standard input is a pipe whose other end only this process holds. When this process closes
    the pipe or ends, the supervisor (`pipeline.execution.supervisor`) ends the process group of the
    build. The job is `job.json` beside its `out`.
    """
    specification = Path(job.out).with_name("job.json")
    specification.write_text(json.dumps(dataclasses.asdict(job), sort_keys=True))
    (stdin, lifeline), (messages, stdout) = os.pipe(), os.pipe()
    with os.fdopen(lifeline, "wb") as alive, os.fdopen(messages, "rb") as lines:
        try:
            supervisor = _start_supervisor(specification, job, stdin, stdout)
        finally:
            os.close(stdin)
            os.close(stdout)
        try:
            received = read_messages(lines, display)
        finally:
            display.close()
            alive.close()
            status = supervisor.wait()
    return _report(received, status, job.log)


def _start_supervisor(
    specification: Path, job: Job, stdin: int, stdout: int
) -> "ForkedProcess | subprocess.Popen[bytes]":
    """Starts a supervisor, by a fork or in its own interpreter.

    Libraries read the number of their threads when they are imported, so a build with its own
    cores has its own interpreter.
    """
    environment = {**build_environment(), **job.environment}
    with Path(job.log).open("ab") as log:
        return start_process(
            "pipeline.execution.supervisor:supervise",
            [str(specification)],
            environment,
            (stdin, stdout, log.fileno()),
            job.inherited_fds,
            is_forked=job.environment.keys().isdisjoint(THREADS),
        )


def _report(received: Mapping[str, Any], status: int, log: str) -> Report:
    """Returns the report from the fields that the builder and the supervisor sent."""
    fields: dict[str, Any] = {"kind": "crash", "status": status}
    fields |= {"seconds": 0.0, "peak_memory_bytes": 0} | dict(received)
    silent = f"ended with status {fields['status']} before it was done. Its log: {log}"
    return Report(**{"message": silent, **fields})


EXECUTORS: Mapping[str, Callable[[Job, Display], Report]] = {
    "inline": build_inline,
    "subprocess": build_in_subprocess,
}
"""The functions that run a build, by the value of [store] executor in `luigi.cfg`."""
