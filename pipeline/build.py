"""One build from start to end: check the inputs, run, check that nothing changed, publish."""

import contextlib
import logging
import shutil
import socket
import time
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from pipeline.artifact_task import ArtifactTask
from pipeline.canonical import Json
from pipeline.errors import LostInputError, TaskFailure
from pipeline.job import Job, Report, write_outcome
from pipeline.publication import publish
from pipeline.record import Action, ActionRecord
from pipeline.settings import boolean_setting, number_setting
from pipeline.store import Store

_log = logging.getLogger("pipeline")


class Executor(Protocol):
    """Runs builds. `pipeline.execution` has the executor of this machine."""

    def run(self, task: ArtifactTask, job: Job) -> Report:
        """Waits for the resources of the build, and builds; the report has the outcome.

        Raises:
            TaskFailure: The build must not start.
        """

    def built(self, task: ArtifactTask, record: ActionRecord, report: Report) -> None:
        """Records a build whose artifact was published."""


def build_once(
    task: ArtifactTask, action: Action, store: Store, executor: Executor
) -> ActionRecord:
    """Returns the record of a build here, after any other process that builds the same key."""
    on_wait = partial(_log.info, "%s: waiting for another process that builds it", task.label)
    is_locking = boolean_setting("store", "locks")
    with store.lock(action.key, on_wait) if is_locking else contextlib.nullcontext():
        try:
            return store.find(action.key) or build(task, action, store, executor)
        except TaskFailure as failure:
            if failure.kind != "changed" and (record := store.find(action.key)):
                return record  # of another process, which built it, too
            raise


def build(task: ArtifactTask, action: Action, store: Store, executor: Executor) -> ActionRecord:
    """Builds the task and publishes its artifact, with two more attempts after transient failures.

    Raises:
        TaskFailure: The build failed. Nothing was published.
        OSError: The disk fails. Nothing was published.
    """
    seconds = number_setting("store", "retry_seconds")
    for pause in (seconds, 4 * seconds):
        try:
            return _attempt(task, action, store, executor)
        except TaskFailure as failure:
            if failure.kind != "transient":
                raise
            _log.info("%s. Trying again in %.0f s.", str(failure).rstrip("."), pause)
            time.sleep(pause)
    return _attempt(task, action, store, executor)


def _attempt(task: ArtifactTask, action: Action, store: Store, executor: Executor) -> ActionRecord:
    inputs = {name: _verified(task, upstream, store) for name, upstream in task.requires().items()}
    with (
        store.workspace(action.key) as workspace,
        store.resume(action.key, workspace) as resume,
    ):
        (workspace / "out").mkdir()
        log = store.new_log(task.task_family, action.key)
        job = Job(
            **_of_task(task),
            inputs={n: str(store.object(r.output.digest)) for n, r in inputs.items()},
            out=str(workspace / "out"),
            resume=str(resume),
            log=str(log),
            key=action.key,
        )
        with _reason_in(log):
            report = executor.run(task, job)
            started = datetime.now(UTC) - timedelta(seconds=report.seconds)
            _require_success(task, report, log)
            _require_unchanged(task, action)
            _require_untouched(task, inputs.values(), store)
            facts: dict[str, Json] = {"started": started.isoformat(timespec="milliseconds")}
            facts |= _facts(task, report, log, store)
            record = publish(store, workspace / "out", action, facts)
        shutil.rmtree(resume, ignore_errors=True)
        write_outcome(log, "built", f"done in {report.seconds:.0f} s")
    task.artifacts.upload(record)
    executor.built(task, record, report)
    _log.info("%s: done in %.0f s", task.label, report.seconds)
    return record


def _of_task(task: ArtifactTask) -> dict[str, Any]:
    """Returns the fields of a job that depend on its task alone."""
    return {
        "module": type(task).__module__,
        "task": type(task).__qualname__,
        "parameters": task.to_str_params(),  # type: ignore[no-untyped-call]
        "label": task.label,
        "lineage": task.lineage(),
    }


def _facts(task: ArtifactTask, report: Report, log: Path, store: Store) -> dict[str, Json]:
    """Returns the provenance of the build for its record."""
    return {
        "task": str(task),
        "label": task.label,
        "host": socket.gethostname(),
        "seconds": round(report.earlier_seconds + report.seconds, 3),
        "earlier_seconds": round(report.earlier_seconds, 3),
        "peak_memory_bytes": report.peak_memory_bytes,
        "cpu_seconds": round(report.cpu_seconds, 3),
        "other_cpu_seconds": round(report.other_cpu_seconds, 3),
        "gpu": report.gpu,
        "cores": report.cores,
        "log": log.relative_to(store.root).as_posix(),
        **task.provenance(store),
    }


def _verified(task: ArtifactTask, upstream: ArtifactTask, store: Store) -> ActionRecord:
    """Returns the record of an input, after a check of every byte of its object."""
    record = upstream.record()
    if record and task.artifacts.fetch(record):
        if kind := store.find_damage(record, deep=True):
            _log.warning("%s: its input %s is %s", task.label, upstream.label, kind)
        if task.artifacts.restore(record, kind):
            return record
    upstream.forget()
    raise LostInputError(upstream)


_REMEDIES = {
    "killed": "Run the same command again",
    "memory": "Run fewer builds at once, or allow more memory with --{}-memory-gib",
    "timeout": "Allow more time with --{}-timeout-seconds",
}


@contextlib.contextmanager
def _reason_in(log: Path) -> Iterator[None]:
    """Writes the reason of a failed attempt to its log; until it ends, it is interrupted.

    Another error than a failure leaves no outcome here: the caller writes one of its own.
    """
    write_outcome(log, "interrupted", "")
    try:
        yield
    except TaskFailure as failure:
        write_outcome(log, failure.kind, failure.reason)
        raise
    except Exception:
        log.with_suffix(".json").unlink(missing_ok=True)
        raise


def _require_success(task: ArtifactTask, report: Report, log: Path) -> None:
    if report.kind == "built":
        return
    reason = report.message
    if report.kind in _REMEDIES:
        used = f"{report.seconds:.0f} s, {report.peak_memory_bytes / 2**30:.1f} GiB"
        remedy = _REMEDIES[report.kind].format(task.task_family)
        reason = f"{reason} ({used}). {remedy}. Its log: {log}"
    raise TaskFailure(report.kind, str(task), reason)


def _require_untouched(task: ArtifactTask, inputs: Iterable[ActionRecord], store: Store) -> None:
    """Refuses a build whose inputs changed while it ran, since it may have read both versions."""
    for record in inputs:
        if kind := store.find_damage(record, deep=True):
            task.artifacts.restore(record, kind)
        if kind in ("altered", "missing"):
            what = f"its input {record.provenance['label']} was {kind} while it ran, and set aside"
            remedy = "The result was not kept. Run the same command again"
            raise TaskFailure("changed", str(task), f"{what}. {remedy}.")


def _require_unchanged(task: ArtifactTask, action: Action) -> None:
    """Refuses a build that may have read other code or other files than its key covers."""
    if task.action(refresh=True) != action:
        raise TaskFailure(
            "changed",
            str(task),
            "its code or files were edited while it ran. Its result may mix two versions, so it was"
            " not kept. Run the same command again.",
        )
