"""One build from first to last: check what goes in, run, check that nothing moved, publish."""

import contextlib
import logging
import shutil
import signal
import socket
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.canonical import Json
from pipeline.errors import TaskFailure
from pipeline.execution import EXECUTORS, REFUSED, Job, Report, is_interactive
from pipeline.publication import publish
from pipeline.record import Action, ActionRecord
from pipeline.settings import setting
from pipeline.store import Store

if TYPE_CHECKING:
    from pipeline.task import StoredTask

screen = logging.getLogger("pipeline")


def find_or_build(task: "StoredTask", action: Action, store: Store) -> ActionRecord:
    """The record of the action: the one there is, or that of a build of our own."""
    if record := store.find(action.key):
        return record

    def say_so() -> None:
        screen.info("%s: another process is at it, waiting", task.label)

    is_locking = setting("store", "locks") == "true"
    with store.lock(action.key, say_so) if is_locking else contextlib.nullcontext():
        return store.find(action.key) or build(task, action, store)


def build(task: "StoredTask", action: Action, store: Store) -> ActionRecord:
    """Build the task in a fresh workspace and publish what it made.

    Raises:
        TaskFailure: With the reason; nothing was published.
        OSError: When the disk fails; nothing was published.
    """
    inputs = {name: _verified(task, upstream, store) for name, upstream in task.requires().items()}
    log, started = store.new_log(task.task_family, action.key), datetime.now(UTC)
    screen.info("%s: started", task.label)
    with store.workspace(action.key) as workspace:
        (workspace / "out").mkdir()
        job = _job(task, inputs, workspace / "out", store.resume(action.key), log)
        report = EXECUTORS[setting("store", "executor")](job, workspace, task.timeout_seconds)
        _require_success(task, report, log)
        _require_unchanged(task, action)
        provenance: dict[str, Json] = {
            "task": str(task),
            "label": task.label,
            "host": socket.gethostname(),
            "started": started.isoformat(timespec="seconds"),
            "seconds": round(report.seconds, 3),
            "peak_memory_bytes": report.peak_memory_bytes,
            "log": log.relative_to(store.root).as_posix(),
        }
        record = publish(store, workspace / "out", action, provenance)
    shutil.rmtree(store.resume(action.key), ignore_errors=True)
    screen.info("%s: done in %.0f s", task.label, report.seconds)
    return record


def _verified(task: "StoredTask", upstream: "StoredTask", store: Store) -> Path:
    """Where the input lies, after a look at the sizes of its files."""
    record = upstream.record()
    if record and store.intact(record):
        return store.object(record.output.digest)
    upstream.forget()
    if record:
        store.quarantine(store.object(record.output.digest))
    reason = "is damaged, and was set aside" if record else "is gone"
    remedy = "Run the same command again to make it anew."
    raise TaskFailure("changed", str(task), f"its input {upstream} {reason}. {remedy}")


def _job(task: "StoredTask", inputs: Mapping[str, Path], out: Path, resume: Path, log: Path) -> Job:
    parameters = dict(task.get_params())  # type: ignore[no-untyped-call]
    return Job(
        module=type(task).__module__,
        task=type(task).__qualname__,
        parameters={name: parameters[name].serialize(v) for name, v in task.param_kwargs.items()},
        label=task.label,
        inputs={name: str(path) for name, path in inputs.items()},
        out=str(out),
        resume=str(resume),
        log=str(log),
        interactive=is_interactive(),
        lineage=task.lineage(),
    )


def _require_success(task: "StoredTask", report: Report, log: Path) -> None:
    name, spent = str(task), f"{report.seconds:.0f} s, {report.peak_memory_bytes / 2**30:.1f} GiB"
    if report.timed_out:
        raise TaskFailure("timeout", name, f"took too long and was ended ({spent}). Its log: {log}")
    if report.status < 0:
        guess = " Most often the machine ran out of memory." * (report.status == -signal.SIGKILL)
        cause = signal.Signals(-report.status).name
        raise TaskFailure("killed", name, f"ended by {cause} ({spent}).{guess} Its log: {log}")
    if report.status:
        message = report.message or f"ended with status {report.status}. Its log: {log}"
        raise TaskFailure("user" if report.status == REFUSED else "crash", name, message)


def _require_unchanged(task: "StoredTask", action: Action) -> None:
    """Raise when the build may have read other code or other files than the key says."""
    if task.action(refresh=True) != action:
        raise TaskFailure(
            "changed",
            str(task),
            "its code or the files it reads were edited meanwhile, so its result cannot be told"
            " from another's and was not kept. Run the same command again.",
        )
