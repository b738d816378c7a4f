"""What the process of a build does: it imports the task, builds, and returns how that went."""

import contextlib
import importlib
import logging
from pathlib import Path
from typing import Literal

from pipeline.artifact_task import ArtifactTask
from pipeline.errors import FailureKind, append_trace, describe_error
from pipeline.job import Display, Job, RunContext
from pipeline.settings import current_store


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
