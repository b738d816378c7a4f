"""Attempts at builds: which of them are running, and how the others ended."""

import contextlib
import json
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import luigi

from pipeline.errors import Errors, StoreError
from pipeline.locks import is_held
from pipeline.maintenance.task_graph import stored_tasks
from pipeline.shared_store.sync import SharedArtifacts
from pipeline.store import Store
from pipeline.task import StoredTask

EPOCH = datetime.fromtimestamp(0, UTC)


@dataclass(frozen=True, slots=True)
class Attempt:
    """A build that was started.

    Attributes:
        log: Its log.
        kind: "built", the kind of the failure, "interrupted" if it was ended with its command or
            has not ended, or "" if it could not write its outcome.
        end: The reason, or the last line of the log.
        is_under_way: Whether a process holds the lock of its key.
    """

    log: Path
    kind: str
    end: str
    is_under_way: bool

    @property
    def is_published(self) -> bool:
        """Returns whether its artifact was published."""
        return self.kind == "built"


@dataclass(frozen=True, slots=True)
class BlockingFailure:
    """The stage that prevents another stage, with the reason, or that is running now."""

    task: StoredTask
    reason: str
    is_under_way: bool = False
    kind: str = "user"


def attempts(
    store: Store, family: str = "*", key: str = "", since: datetime = EPOCH
) -> list[Attempt]:
    """Returns the logged attempts at builds of a family, or at one key, oldest first.

    Attempts that ended before `since` are left out.
    """
    logs = (store.root / "logs").glob(f"{family}/{key[:16]}*.log")
    found = [_attempt(store, log) for log in sorted(logs, key=_changed)]
    return [a for a in found if a.is_under_way or a.log.stat().st_mtime >= since.timestamp()]


def find_blocking_failure(
    task: luigi.Task, store: Store, since: datetime = EPOCH
) -> BlockingFailure | None:
    """Returns the obstacle of a task: a failure, or else a running build; or None.

    It uses the last attempt here at each stage whose inputs are complete. An interrupted attempt is
    no failure, nor is one at an artifact that is available, here or in the shared store.

    Args:
        task: The task that is not made.
        store: The store with the logs of attempts.
        since: Earlier failures do not count.
    """
    missing: set[StoredTask] = set()
    found: list[BlockingFailure] = []
    for each in stored_tasks(task):
        if missing & set(each.requires().values()):
            missing.add(each)
            continue
        is_made, problem = _state(each, store, since)
        missing |= set() if is_made else {each}
        found += [problem] if problem else []
    return min(found, key=lambda problem: problem.is_under_way, default=None)


def _state(task: StoredTask, store: Store, since: datetime) -> tuple[bool, BlockingFailure | None]:
    """Returns whether a task with complete inputs was made, and the failure that prevents it."""
    repairable: Errors = (StoreError, OSError, *task.user_errors)
    try:
        key = task.action().key
    except repairable as error:
        return False, BlockingFailure(task, str(error))
    record = store.record(key)
    if record and store.intact(record):
        return True, None
    for last in attempts(store, task.task_family, key, since)[-1:]:
        is_obstacle = last.is_under_way or last.kind not in ("built", "interrupted")
        if is_obstacle and not (record and SharedArtifacts(store).is_available(record)):
            return False, BlockingFailure(task, last.end, last.is_under_way, last.kind)
    return record is not None, None  # a collected artifact is in nobody's way


def _attempt(store: Store, log: Path) -> Attempt:
    kind, end = _read_outcome(log)
    locks = (store.root / "locks").glob(f"{log.name[:2]}/{log.name.partition('.')[0]}*")
    is_under_way = any(is_held(lock) for lock in locks)
    if not end and not is_under_way:
        problem = "it was interrupted" if kind else "it wrote nothing; the disk may be full"
        end = f"{problem}. Its log: {log}"
    return Attempt(log, kind, end, is_under_way)


def _read_outcome(log: Path) -> tuple[str, str]:
    """Returns the outcome that `write_outcome` wrote; without a reason, the log's last line."""
    kind = reason = ""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        outcome = json.loads(log.with_suffix(".json").read_text())
        kind, reason = str(outcome["kind"]), str(outcome["reason"])
    return kind, reason or log.read_text(errors="replace").strip().rpartition("\n")[2]


def _changed(log: Path) -> tuple[int, str]:
    return log.stat().st_mtime_ns, log.name
