"""Submission of builds to a cluster, and their records in the shared store."""

import contextlib
import logging
import math
import os
import time
from dataclasses import replace
from pathlib import Path

from pipeline.artifact_task import ArtifactTask
from pipeline.cluster.backends import BACKENDS, Backend
from pipeline.cluster.remote_job import JobResult, RemoteJob
from pipeline.code.interpreters import interpreter_environment
from pipeline.errors import LostInputError, TaskFailure
from pipeline.execution.deadline import require_time_left
from pipeline.execution.host_locks import LEASES
from pipeline.execution.options import BuildOptions
from pipeline.execution.resources import CORES, expected_cost
from pipeline.job import write_outcome
from pipeline.record import Action, ActionRecord
from pipeline.settings import number_setting
from pipeline.shared_store.settings import PATIENCE, current_remote
from pipeline.shared_store.sync import SharedArtifacts
from pipeline.store import Store

_PATIENCE_S = 300.0  # for which a node retries if the shared store fails
_SECONDS_FOR_REMOTE = 600.0
_SECONDS_TO_APPEAR = 90.0  # NFS may cache for a minute that a file does not exist
_SECONDS_EXCLUDED = 600.0
_MAX_NODES = 3
_FULL = ".full"
_log = logging.getLogger("pipeline")


def build_on_cluster(
    task: ArtifactTask, action: Action, store: Store, options: BuildOptions
) -> ActionRecord:
    """Builds the task on a node of the cluster; returns the record that the node wrote.

    Args:
        task: The task to build.
        action: Its action on this machine.
        store: The store of this machine. The node uses the same one, or both share a remote.
        options: The options of the build. The executor is the name of a backend.

    Raises:
        TaskFailure: The build failed, or its record cannot be found.
        LostInputError: An input is missing or damaged on the node.
        StoreError: The cluster cannot be used.
    """
    cost = expected_cost(task, store)
    try:
        require_time_left(task, options.until, cost)
    except TaskFailure as late:
        write_outcome(store.new_log(task.task_family, action.key), late.kind, late.reason)
        raise
    _log.info("%s: submitted to %s", task.label, options.executor)
    for upstream in task.requires().values():
        if record := upstream.record():
            task.artifacts.upload(record)  # it may be older than the shared store
    memory_bytes = cost.peak_memory_bytes if cost else 0
    job = remote_job_of(task, action.key, memory_bytes, options.max_gpus)
    result = _submit(BACKENDS[options.executor], job, store)
    record = _await_record(action, store, result)
    if record:  # a node may be lost right after its build
        _log.info("%s: done on %s", task.label, result.host or record.provenance["host"])
        return record
    raise _failure(task, action, store, result)


def remote_job_of(task: ArtifactTask, key: str, memory_bytes: int, max_gpus: int) -> RemoteJob:
    """Returns the job that builds a task on a node."""
    cores = math.ceil(number_setting("host", "cores"))
    parameters: dict[str, str] = task.to_str_params()  # type: ignore[no-untyped-call]
    return RemoteJob(
        module=type(task).__module__,
        task=type(task).__qualname__,
        parameters=parameters | {"executor": "subprocess"},
        key=key,
        cores=cores,
        gpus=max_gpus,
        memory_bytes=memory_bytes,
        folder=str(Path.cwd()),
        environment={
            **{name: value for name, value in os.environ.items() if _is_forwarded(name)},
            CORES: str(cores),
            PATIENCE: str(current_remote().patience_seconds or _PATIENCE_S),
            "PYTHONPATH": interpreter_environment()["PYTHONPATH"],
        },
    )


def _is_forwarded(variable: str) -> bool:
    """Whether nodes get a variable: the project's own, but no folder of one host or credentials."""
    is_own = variable.startswith("STYLETRF_") and variable != LEASES
    return is_own or variable == "LUIGI_CONFIG_PATH"


def _submit(
    backend: Backend, job: RemoteJob, store: Store, max_nodes: int = _MAX_NODES
) -> JobResult:
    """Runs the job, and again on another node if the disk is full, on up to `max_nodes` in all.

    If the nodes share one folder, they share its full disk, so there is one attempt only.
    """
    job = replace(job, excluded_nodes=_full_nodes(store))
    result = backend(job)
    is_known = result.node in ("", *job.excluded_nodes)
    if result.kind != "disk" or is_known or not current_remote().url or max_nodes == 1:
        return result
    _log.info("%s on %s: moved to another node. %s", job.task, result.host, result.message)
    (store.root / "quarantine" / f"{result.node}{_FULL}").touch()
    return _submit(backend, job, store, max_nodes - 1)


def _full_nodes(store: Store) -> tuple[str, ...]:
    """Returns the nodes with full disks in the last ten minutes, in any command on this store."""
    since = time.time() - _SECONDS_EXCLUDED
    marks = sorted((store.root / "quarantine").glob(f"*{_FULL}"))
    return tuple(p.name.removesuffix(_FULL) for p in marks if p.stat().st_mtime > since)


def _await_record(action: Action, store: Store, result: JobResult) -> ActionRecord | None:
    """Returns the record that a node wrote; None if there is none.

    After a successful job it waits for the record. The shared store may not answer, and NFS may
    show the state of a minute ago.
    """
    started_s = time.monotonic()
    while True:
        if record := SharedArtifacts(store).find(action.key):
            return record
        is_away = current_remote().is_open("reading")
        limit_s = _SECONDS_FOR_REMOTE if is_away else _SECONDS_TO_APPEAR
        if result.kind != "built" or time.monotonic() > started_s + limit_s:
            return None
        _refresh_nfs_cache(store.action(action.key))
        time.sleep(1)


def _refresh_nfs_cache(path: Path) -> None:
    """Lists the folders above a path, which refreshes the cache of an NFS client."""
    for folder in (path.parent.parent, path.parent):
        with contextlib.suppress(OSError):
            os.listdir(folder)  # noqa: PTH208


def _failure(
    task: ArtifactTask, action: Action, store: Store, result: JobResult
) -> TaskFailure | LostInputError:
    """Returns the error of a job without a record, and writes it to a log in this store."""
    for upstream in task.requires().values():
        if (result.kind, result.message) == ("lost", upstream.task_id):
            return LostInputError(upstream)
    where = f" (on {result.host})" if result.host else ""
    kind, reason = result.kind, f"{result.message.rstrip('.')}{where}."
    if kind == "built" or kind == "lost":
        kind, reason = "user", _without_shared_store(result)
    write_outcome(store.new_log(task.task_family, action.key), kind, reason)
    return TaskFailure(kind, str(task), reason)


def _without_shared_store(result: JobResult) -> str:
    is_built = result.kind == "built"
    problem = "has built it, but its result cannot be found here" if is_built else "has no input"
    return (
        f"{result.host} {problem}. The two machines share no store, or the shared store does not"
        " answer. Name the same folder as STYLETRF_STORE, or the same STYLETRF_REMOTE, on all"
        " machines."
    )
