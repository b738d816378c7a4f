"""Running one build: here (`inline`, for tests) or in a fresh interpreter (`subprocess`)."""

import contextlib
import dataclasses
import importlib
import json
import logging
import os
import resource
import subprocess
import sys
import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Literal, Protocol, cast

from pipeline.channel import follow
from pipeline.console.progress import Display
from pipeline.errors import FailureKind, explain
from pipeline.host import openmp_wait_settings
from pipeline.record import ActionRecord
from pipeline.settings import current_store

if TYPE_CHECKING:
    from pipeline.task import StoredTask


@dataclass(frozen=True, slots=True)
class RunContext:
    """What a build may use besides its inputs.

    Attributes:
        progress: To be called every second or so.
        resume: A directory private to the build, for checkpoints; as a rule, it survives kills.
        log: The file that takes standard output and standard error.
        lineage: The records of all artifacts upstream, first things first.
    """

    progress: Display
    resume: Path
    log: Path
    lineage: tuple[ActionRecord, ...] = ()


@dataclass(frozen=True, slots=True)
class Job:
    """One build, as JSON can tell it to another interpreter.

    Attributes:
        module: Where the task's class is.
        task: The class.
        parameters: The task's parameters, serialised.
        label: The task on the screen.
        inputs: The directories of the artifacts to read, by name.
        out: The directory to fill; what lies beside it is the executor's.
        resume: The directory of checkpoints.
        log: The file for what the build prints.
        lineage: Keys of the records upstream.
        timeout_seconds: When to end the build, if not 0.
        memory_limit_bytes: At which resident memory of its processes to end it, if not 0.
        environment: Variables to set.
        holds: Descriptors to hold open; their flocks are leases.
        bound_to: The cores to run on; none: all.
    """

    module: str
    task: str
    parameters: dict[str, str]
    label: str
    inputs: dict[str, str]
    out: str
    resume: str
    log: str
    lineage: tuple[str, ...] = ()
    timeout_seconds: float = 0.0
    memory_limit_bytes: int = 0
    environment: Mapping[str, str] = field(default_factory=dict)
    holds: tuple[int, ...] = ()
    bound_to: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Report:
    """How a build ended.

    Attributes:
        kind: "built", or the kind of `TaskFailure` that it was.
        message: Why it did not succeed.
        status: Its exit status, or minus the signal that ended it.
        seconds: Wall-clock time.
        earlier_seconds: That of attempts which ended early, and whose checkpoints it went on from.
        peak_memory_bytes: Largest resident memory, of all processes of the build together.
        cpu_seconds: What the build took of the cores.
        other_cpu_seconds: What everything else on the machine took of them meanwhile.
    """

    kind: Literal["built"] | FailureKind
    message: str
    status: int
    seconds: float
    peak_memory_bytes: int
    earlier_seconds: float = 0.0
    cpu_seconds: float = 0.0
    other_cpu_seconds: float = 0.0


class Executor(Protocol):
    """Who runs builds, and keeps to all that the job says."""

    def run(self, job: Job, display: Display) -> Report:
        """Build, and show how it goes; whatever happens to the build is in the report."""


class Inline:
    """Builds in this interpreter, without limits: for tests and debuggers."""

    def run(self, job: Job, display: Display) -> Report:
        """Build here."""
        started = time.monotonic()
        kind, message = perform(job, display)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        return Report(kind, message, kind != "built", time.monotonic() - started, peak)


class Subprocess:
    """Builds in a fresh interpreter that, with all it starts, never outlives the call.

    Its standard input is a pipe whose other end only we hold: when we close it, or die however
    suddenly, the supervisor there (see `pipeline.execute`) ends the build's process group.
    """

    def run(self, job: Job, display: Display) -> Report:
        """Build there; the job lies beside its `out` as `job.json`."""
        specification = Path(job.out).with_name("job.json")
        specification.write_text(json.dumps(dataclasses.asdict(job), sort_keys=True))
        with self._start(specification, job) as supervisor:
            try:
                told = follow(cast("IO[bytes]", supervisor.stdout), display)
            finally:
                display.close()
                supervisor.communicate()  # which first closes its standard input
        return self._report(told, supervisor.returncode, job.log)

    def _start(self, specification: Path, job: Job) -> subprocess.Popen[bytes]:
        """A supervisor that reports on its standard output."""
        environment = {**os.environ, **openmp_wait_settings(os.environ), "PYTHONUNBUFFERED": "1"}
        environment |= job.environment
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
        command = [sys.executable, "-P", "-m", "pipeline.execute", str(specification)]
        with Path(job.log).open("ab") as log:
            return subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                pass_fds=job.holds,
                env=environment,
                start_new_session=True,
            )

    def _report(self, told: Mapping[str, Any], status: int, log: str) -> Report:
        """Put together what the builder and the supervisor told."""
        fields: dict[str, Any] = {"kind": "crash", "status": status}
        fields |= {"seconds": 0.0, "peak_memory_bytes": 0} | dict(told)
        silent = f"ended with status {fields['status']} before it was done. Its log: {log}"
        return Report(**{"message": silent, **fields})


EXECUTORS: Mapping[str, Executor] = {"inline": Inline(), "subprocess": Subprocess()}
"""By the word in [store] executor of `luigi.cfg`."""


def perform(job: Job, display: Display) -> tuple[Literal["built"] | FailureKind, str]:
    """Build the job's task; returns how it went and, on failure, what to tell the user."""
    log = Path(job.log)
    task_class: type[StoredTask] = getattr(importlib.import_module(job.module), job.task)
    try:
        task: StoredTask = task_class.from_str_params(job.parameters)  # type: ignore[no-untyped-call]
        inputs = {name: Path(path) for name, path in job.inputs.items()}
        records = (current_store().record(key) for key in job.lineage)
        lineage = tuple(record for record in records if record)
        with _Warnings(job.label, display, log):
            task.build(inputs, Path(job.out), RunContext(display, Path(job.resume), log, lineage))
    except Exception as error:  # noqa: BLE001  whatever it is, it is this build's end
        append_trace(log)
        return explain(error, log, task_class.user_errors, task_class.transient_errors)
    finally:
        display.close()
    return "built", ""


class _Warnings(logging.Handler):
    """What a build logs as a warning: a line that is shown, and one in its log."""

    def __init__(self, label: str, display: Display, log: Path) -> None:
        super().__init__(logging.WARNING)
        self._label, self._display, self._log = label, display, log

    def __enter__(self) -> None:
        logging.getLogger().addHandler(self)

    def __exit__(self, *_raised: object) -> None:
        logging.getLogger().removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Write the warning; a full disk is no reason to end."""
        line = f"{self._label}: warning: {' '.join(record.getMessage().split())}"
        self._display.say(line)
        with contextlib.suppress(OSError), self._log.open("a") as file:
            file.write(f"{line}\n")


def append_trace(log: Path) -> None:
    """Add the exception being handled to a log, if the disk has room for it."""
    with contextlib.suppress(OSError), log.open("a") as file:
        traceback.print_exc(file=file)
