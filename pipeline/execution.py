"""Running one build: here (`inline`, for tests) or in a fresh interpreter (`subprocess`)."""

import contextlib
import dataclasses
import importlib
import json
import multiprocessing
import os
import resource
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from pipeline.errors import explain
from pipeline.progress import Progress, ProgressBar
from pipeline.record import ActionRecord
from pipeline.settings import current_store

if TYPE_CHECKING:
    from pipeline.task import StoredTask

BUILT, CRASHED, REFUSED = 0, 1, 65
"""Exit statuses of a build; 65 (EX_DATAERR) means that the user's input was refused."""


@dataclass(frozen=True, slots=True)
class RunContext:
    """What a build may use besides its inputs.

    Attributes:
        progress: To be called every second or so.
        resume: A directory private to the key that survives kills, for checkpoints.
        log: The file that takes standard output and standard error.
        lineage: The records of all artifacts upstream, first things first.
    """

    progress: Progress
    resume: Path
    log: Path
    lineage: tuple[ActionRecord, ...] = ()


@dataclass(frozen=True, slots=True)
class Job:
    """One build, as JSON can tell it to another interpreter."""

    module: str
    task: str
    parameters: dict[str, str]
    label: str
    inputs: dict[str, str]
    out: str
    resume: str
    log: str
    interactive: bool
    lineage: tuple[str, ...] = ()  # keys; the builder reads the records


@dataclass(frozen=True, slots=True)
class Report:
    """How a build ended.

    Attributes:
        status: Exit status (`BUILT`, `CRASHED`, `REFUSED`), or minus the signal that ended it.
        message: Why it did not succeed.
        seconds: Wall-clock time.
        peak_memory_bytes: Largest resident memory.
        timed_out: Whether it was ended because of its time.
    """

    status: int
    message: str
    seconds: float
    peak_memory_bytes: int
    timed_out: bool = False


def run_inline(job: Job, _workspace: Path, _timeout_seconds: float | None) -> Report:
    """Build in this interpreter."""
    started = time.monotonic()
    status, message = perform(job, sys.stderr)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return Report(status, message, time.monotonic() - started, peak)


def run_in_subprocess(job: Job, workspace: Path, timeout_seconds: float | None) -> Report:
    """Build in a fresh interpreter that, with all it starts, never outlives this call.

    Its standard input is a pipe whose other end only we hold: when we close it, or die however
    suddenly, the supervisor there (see `pipeline.execute`) ends the build's process group.
    """
    specification = workspace / "job.json"
    specification.write_text(json.dumps(dataclasses.asdict(job), sort_keys=True))
    timed_out = False
    with _start(specification, Path(job.log)) as supervisor:
        try:
            supervisor.wait(timeout_seconds)
        except subprocess.TimeoutExpired:
            timed_out = True
        finally:
            said = supervisor.communicate()[0]  # which first closes its standard input
    return _report(said, supervisor.returncode, timed_out=timed_out)


def _start(specification: Path, log_path: Path) -> subprocess.Popen[bytes]:
    """A supervisor that reports on its standard output and may draw on our standard error."""
    terminal = os.dup(2)
    search_path = os.pathsep.join(filter(None, sys.path))
    try:
        with log_path.open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-P", "-m", "pipeline.execute", specification, str(terminal)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                pass_fds=(terminal,),
                env={**os.environ, "PYTHONPATH": search_path, "PYTHONUNBUFFERED": "1"},
                start_new_session=True,
            )
    finally:
        os.close(terminal)


def _report(said: bytes, status: int, *, timed_out: bool) -> Report:
    """Put together what the builder and the supervisor said, a JSON object a line each."""
    fields: dict[str, Any] = {"message": "", "seconds": 0.0, "peak_memory_bytes": 0}
    fields["status"] = status or CRASHED  # unless the supervisor lived to tell the builder's
    for line in said.splitlines():
        fields |= json.loads(line)
    return Report(**fields, timed_out=timed_out)


EXECUTORS: dict[str, Callable[[Job, Path, float | None], Report]] = {
    "inline": run_inline,
    "subprocess": run_in_subprocess,
}


def perform(job: Job, terminal: TextIO) -> tuple[int, str]:
    """Build the job's task; returns the exit status and, on failure, what to tell the user."""
    bar, log = ProgressBar(job.label, terminal, interactive=job.interactive), Path(job.log)
    user_errors: tuple[type[Exception], ...] = ()
    try:
        task = _load(job)
        user_errors = task.user_errors
        inputs = {name: Path(path) for name, path in job.inputs.items()}
        records = (current_store().record(key) for key in job.lineage)
        lineage = tuple(record for record in records if record)
        task.build(inputs, Path(job.out), RunContext(bar, Path(job.resume), log, lineage))
    except Exception as error:  # noqa: BLE001  whatever it is, it is this build's end
        append_trace(log)
        kind, message = explain(error, user_errors, log)
        return (REFUSED if kind == "user" else CRASHED), message
    finally:
        bar.close()
    return BUILT, ""


def append_trace(log: Path) -> None:
    """Add the exception being handled to a log, if the disk has room for it."""
    with contextlib.suppress(OSError), log.open("a") as file:
        traceback.print_exc(file=file)


def is_interactive() -> bool:
    """Whether one bar may be drawn on standard error: a wide terminal, no parallel worker."""
    is_alone = multiprocessing.parent_process() is None
    return is_alone and os.isatty(2) and os.get_terminal_size(2).columns > 0


def _load(job: Job) -> "StoredTask":
    task_class = getattr(importlib.import_module(job.module), job.task)
    task: StoredTask = task_class.from_str_params(job.parameters)
    return task
