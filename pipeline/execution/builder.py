"""The work of a build process: imports the task, builds it, and returns the outcome."""

import contextlib
import importlib
import logging
from pathlib import Path
from typing import Literal

from pipeline.artifact_task import ArtifactTask
from pipeline.errors import FailureKind, describe_error
from pipeline.job import Display, Job, RunContext, append_trace
from pipeline.settings import current_store


def run_job(job: Job, display: Display) -> tuple[Literal["built"] | FailureKind, str]:
    """Builds the job's task; returns its outcome and, on failure, the message for the user."""
    log = Path(job.log)
    task_class: type[ArtifactTask] = getattr(importlib.import_module(job.module), job.task)
    try:
        task: ArtifactTask = task_class.from_str_params(job.parameters)  # type: ignore[no-untyped-call]
        inputs = {name: Path(path) for name, path in job.inputs.items()}
        records = (current_store().record(key) for key in job.lineage)
        lineage = tuple(record for record in records if record)
        with _Warnings(job.label, display, log):
            reported = task.display_of_build(display)
            task.build(inputs, Path(job.out), RunContext(reported, Path(job.resume), log, lineage))
    except Exception as error:  # noqa: BLE001  every error ends this build
        append_trace(log)
        return describe_error(error, log, task_class.user_errors, task_class.transient_errors)
    finally:
        display.close()
    return "built", ""


class _Warnings(logging.Handler):
    """A handler that shows the warnings of a build, and writes them to its log."""

    def __init__(self, label: str, display: Display, log: Path) -> None:
        super().__init__(logging.WARNING)
        self._label, self._display, self._log = label, display, log

    def __enter__(self) -> None:
        logging.getLogger().addHandler(self)

    def __exit__(self, *_raised: object) -> None:
        logging.getLogger().removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Writes the warning. A full disk does not end the build."""
        line = f"{self._label}: warning: {' '.join(record.getMessage().split())}"
        self._display.say(line)
        with contextlib.suppress(OSError), self._log.open("a") as file:
            file.write(f"{line}\n")
