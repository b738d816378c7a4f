"""One build from first to last: check what goes in, run, check that nothing moved, publish."""

import contextlib
import logging
import shutil
import socket
import time
from collections.abc import Callable, Iterable, Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from pipeline.canonical import Json
from pipeline.checkpoints import forget_checkpoints, shared_checkpoints
from pipeline.code_identity import closure, keep
from pipeline.console.display import build_display
from pipeline.costs import USUAL_SECONDS, Cost, Spent, note
from pipeline.deadline import require_time_left
from pipeline.errors import LostInputError, TaskFailure
from pipeline.execution import EXECUTORS, Job, Report
from pipeline.gpu import VISIBLE
from pipeline.publication import publish
from pipeline.record import Action, ActionRecord
from pipeline.resources import card_for, executor_of, expected_cost, share_for, significant
from pipeline.settings import setting
from pipeline.sharing import fetch, give, is_available, recorded
from pipeline.store import Store
from pipeline.verify import damage, mend

if TYPE_CHECKING:
    from pipeline.task import StoredTask

DONE = "done in"
"""How the log of a build that was published ends; then come the seconds."""
Builder: TypeAlias = Callable[["StoredTask", Action, Store], ActionRecord]
"""Builds a task, here or on a cluster, and returns the record of its artifact."""
screen = logging.getLogger("pipeline")


def find_or_build(
    task: "StoredTask", action: Action, store: Store, builder: "Builder | None" = None
) -> ActionRecord:
    """The record of the action: the one in the store, or else that of a new build.

    Args:
        task: The task.
        action: Its action.
        store: The store of this machine.
        builder: What builds the task; `build_here` if it is None.
    """
    record = recorded(store, action.key)
    if record and is_available(store, record) and (task.published() or fetch(store, record)):
        return record
    return (builder or build_here)(task, action, store)


def build_here(task: "StoredTask", action: Action, store: Store) -> ActionRecord:
    """The record of a build on this machine, after any other process here that builds the same."""
    say_so = partial(screen.info, "%s: another process is at it, waiting", task.label)
    is_locking = setting("store", "locks") == "true"
    with store.lock(action.key, say_so) if is_locking else contextlib.nullcontext():
        try:
            return store.find(action.key) or build(task, action, store)
        except TaskFailure as failure:
            if failure.kind != "changed" and (record := store.find(action.key)):
                return record  # of another process, which was at it, too
            raise


def build(task: "StoredTask", action: Action, store: Store) -> ActionRecord:
    """Build the task and publish what it made; try again, twice, where the reason may pass.

    Raises:
        TaskFailure: With the reason; nothing was published.
        OSError: When the disk fails; nothing was published.
    """
    seconds = float(setting("store", "retry_seconds"))
    for pause in (seconds, 4 * seconds):
        try:
            return _attempt(task, action, store)
        except TaskFailure as failure:
            if failure.kind != "transient":
                raise
            screen.info("%s. Trying again in %.0f s.", str(failure).rstrip("."), pause)
            time.sleep(pause)
    return _attempt(task, action, store)


def _attempt(task: "StoredTask", action: Action, store: Store) -> ActionRecord:
    inputs = {name: _verified(task, upstream, store) for name, upstream in task.requires().items()}
    cost = expected_cost(task, store)
    with (
        store.workspace(action.key) as workspace,
        store.resume(action.key, workspace) as resume,
        card_for(task) as (environment, card),
        share_for(task, cost) as share,
        build_display(task, task.label, cost.seconds if cost else USUAL_SECONDS) as display,
    ):
        require_time_left(task, task.until, action.key, cost, store)  # now that it need not wait
        log, started = store.new_log(task.task_family, action.key), datetime.now(UTC)
        screen.info("%s: started", task.label)
        (workspace / "out").mkdir()
        job = Job(
            **_specification(task),
            inputs={n: str(store.object(r.output.digest)) for n, r in inputs.items()},
            out=str(workspace / "out"),
            resume=str(resume),
            log=str(log),
            environment={**dict(share.environment), **environment},
            holds=(*card, *share.holds),
            bound_to=share.bound_to,
        )
        with _told_in(log):
            with shared_checkpoints(action.key, resume):
                report = EXECUTORS[executor_of(task)].run(job, display)
                _require_success(task, report, log)
            _require_unchanged(task, action)
            _require_untouched(task, inputs.values(), store)
        provenance = _provenance(task, report, log, store) | {
            "gpu": environment.get(VISIBLE, ""),
            "cores": share.cores,
            "started": started.isoformat(timespec="milliseconds"),
        }
        record = publish(store, workspace / "out", action, provenance)
        shutil.rmtree(resume, ignore_errors=True)
        _note(log, f"{DONE} {report.seconds:.0f} s")
        _note_cost(task, report, record, store)
    give(store, record)
    forget_checkpoints(action.key)
    screen.info("%s: done in %.0f s", task.label, report.seconds)
    return record


def _note_cost(task: "StoredTask", report: Report, record: ActionRecord, store: Store) -> None:
    """Keep what the build took for plans of later ones."""
    is_whole = not report.earlier_seconds  # whose CPU time is not known
    cost = Cost(
        report.earlier_seconds + report.seconds,
        report.peak_memory_bytes,
        report.cpu_seconds if is_whole else None,
        record.output.size,
    )
    note(store, task.task_family, Spent(significant(task), cost, socket.gethostname()))


def _provenance(task: "StoredTask", report: Report, log: Path, store: Store) -> dict[str, Json]:
    """What a record tells of the build."""
    return {
        "task": str(task),
        "label": task.label,
        "host": socket.gethostname(),
        "seconds": round(report.earlier_seconds + report.seconds, 3),
        "earlier_seconds": round(report.earlier_seconds, 3),
        "peak_memory_bytes": report.peak_memory_bytes,
        "cpu_seconds": round(report.cpu_seconds, 3),
        "other_cpu_seconds": round(report.other_cpu_seconds, 3),
        "log": log.relative_to(store.root).as_posix(),
        "closure": "" if task.revision else keep(closure(type(task)), store),
    }


def _verified(task: "StoredTask", upstream: "StoredTask", store: Store) -> ActionRecord:
    """The record of an input that is here, every byte of it read and found right."""
    record = upstream.record()
    if record and fetch(store, record):
        if kind := damage(store, record, deep=True):
            screen.warning("%s: its input %s is %s", task.label, upstream.label, kind)
        if mend(store, record, kind):
            return record
    upstream.forget()
    raise LostInputError(upstream)


def _specification(task: "StoredTask") -> dict[str, Any]:
    """What the job says of the task alone."""
    memory_gib = task.memory_gib or float(setting("store", "memory_gib"))
    return {
        "module": type(task).__module__,
        "task": type(task).__qualname__,
        "parameters": task.to_str_params(),  # type: ignore[no-untyped-call]
        "label": task.label,
        "lineage": task.lineage(),
        "timeout_seconds": task.timeout_seconds,
        "memory_limit_bytes": int(memory_gib * 2**30),
    }


_REMEDIES = {
    "killed": "Run the same command again",
    "memory": "Run less beside it, or allow it more with --{}-memory-gib",
    "timeout": "Allow it more with --{}-timeout-seconds",
}


@contextlib.contextmanager
def _told_in(log: Path) -> Iterator[None]:
    """End the log with the reason why nothing came of the build."""
    try:
        yield
    except TaskFailure as failure:
        _note(log, failure.reason)
        raise


def _require_success(task: "StoredTask", report: Report, log: Path) -> None:
    if report.kind == "built":
        return
    reason = report.message
    if report.kind in _REMEDIES:
        spent = f"{report.seconds:.0f} s, {report.peak_memory_bytes / 2**30:.1f} GiB"
        remedy = _REMEDIES[report.kind].format(task.task_family)
        reason = f"{reason} ({spent}). {remedy}. Its log: {log}"
    raise TaskFailure(report.kind, str(task), reason)


def _note(log: Path, line: str) -> None:
    """End the log with a line for `ls --failed`."""
    with contextlib.suppress(OSError), log.open("a") as file:
        file.write(f"{line}\n")


def _require_untouched(task: "StoredTask", inputs: Iterable[ActionRecord], store: Store) -> None:
    """Raise when an input has other bytes than before the build, which may have read either."""
    for record in inputs:
        if kind := damage(store, record, deep=True):
            mend(store, record, kind)
        if kind in ("altered", "missing"):
            what = f"its input {record.provenance['label']} was {kind} while it ran, and set aside"
            remedy = "A build only reads its inputs. Its result was not kept: run it again"
            raise TaskFailure("changed", str(task), f"{what}. {remedy}.")


def _require_unchanged(task: "StoredTask", action: Action) -> None:
    """Raise when the build may have read other code or other files than the key says."""
    if task.action(refresh=True) != action:
        raise TaskFailure(
            "changed",
            str(task),
            "its code or the files it reads were edited meanwhile, so its result cannot be told"
            " from another's and was not kept. Run the same command again.",
        )
