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
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, Literal, Protocol, cast

from pipeline.artifact_task import ArtifactTask
from pipeline.errors import FailureKind, append_trace, describe_error
from pipeline.execution.cpu_memory import openmp_wait_settings
from pipeline.execution.progress_pipe import read_messages
from pipeline.job import Display, Job, Report, RunContext
from pipeline.settings import current_store


class BuildProcess(Protocol):
    """Runs a build within all limits of its job."""

    def run(self, job: Job, display: Display) -> Report:
        """Build, and show the progress; whatever happens to the build is in the report."""


class Inline:
    """Builds in this interpreter, without limits: for tests and debuggers."""

    def run(self, job: Job, display: Display) -> Report:
        """Build here."""
        started = time.monotonic()
        kind, message = run_job(job, display)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        return Report(kind, message, kind != "built", time.monotonic() - started, peak)


class Subprocess:
    """Builds in a fresh interpreter that, with all it starts, never outlives the call.

    Its standard input is a pipe whose other end only we hold: when we close it, or die however
    suddenly, the supervisor there (`pipeline.execution.supervisor`) ends the build's process group.
    """

    def run(self, job: Job, display: Display) -> Report:
        """Build there; the job lies beside its `out` as `job.json`."""
        specification = Path(job.out).with_name("job.json")
        specification.write_text(json.dumps(dataclasses.asdict(job), sort_keys=True))
        with self._start(specification, job) as supervisor:
            try:
                received = read_messages(cast("IO[bytes]", supervisor.stdout), display)
            finally:
                display.close()
                supervisor.communicate()  # which first closes its standard input
        return self._report(received, supervisor.returncode, job.log)

    def _start(self, specification: Path, job: Job) -> subprocess.Popen[bytes]:
        """A supervisor that reports on its standard output."""
        environment = {**os.environ, **openmp_wait_settings(os.environ), "PYTHONUNBUFFERED": "1"}
        environment |= job.environment
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
        command = [sys.executable, "-P", "-m", "pipeline.execution.supervisor", str(specification)]
        with Path(job.log).open("ab") as log:
            return subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                pass_fds=job.inherited_fds,
                env=environment,
                start_new_session=True,
            )

    def _report(self, received: Mapping[str, Any], status: int, log: str) -> Report:
        """Returns the report from the fields that the builder and the supervisor sent."""
        fields: dict[str, Any] = {"kind": "crash", "status": status}
        fields |= {"seconds": 0.0, "peak_memory_bytes": 0} | dict(received)
        silent = f"ended with status {fields['status']} before it was done. Its log: {log}"
        return Report(**{"message": silent, **fields})


EXECUTORS: Mapping[str, BuildProcess] = {"inline": Inline(), "subprocess": Subprocess()}
"""By the word in [store] executor of `luigi.cfg`."""


def run_job(job: Job, display: Display) -> tuple[Literal["built"] | FailureKind, str]:
    """Build the job's task; returns how it went and, on failure, what to tell the user."""
    log = Path(job.log)
    task_class: type[ArtifactTask] = getattr(importlib.import_module(job.module), job.task)
    try:
        task: ArtifactTask = task_class.from_str_params(job.parameters)  # type: ignore[no-untyped-call]
        inputs = {name: Path(path) for name, path in job.inputs.items()}
        records = (current_store().record(key) for key in job.lineage)
        lineage = tuple(record for record in records if record)
        with _Warnings(job.label, display, log):
            task.build(inputs, Path(job.out), RunContext(display, Path(job.resume), log, lineage))
    except Exception as error:  # noqa: BLE001  whatever it is, it is this build's end
        append_trace(log)
        return describe_error(error, log, task_class.user_errors, task_class.transient_errors)
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
