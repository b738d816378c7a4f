"""A task built on another machine: sent by an engine, found in the store that both share."""

import contextlib
import logging
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.deadline import require_time_left
from pipeline.engines import ENGINES, Engine
from pipeline.errand import Errand, Outcome
from pipeline.errors import LostInputError, TaskFailure
from pipeline.record import Action, ActionRecord
from pipeline.resources import executor_of, expected_cost
from pipeline.settings import current_remote
from pipeline.sharing import give, is_available, recorded
from pipeline.store import Store

if TYPE_CHECKING:
    from pipeline.task import StoredTask

_SECONDS_FOR_THE_STORE = 600.0
_SECONDS_TO_APPEAR = 90.0  # NFS remembers for a minute that a file was not there
_SECONDS_FULL = 600.0
_MOST_MACHINES = 3
_FULL = ".full"
screen = logging.getLogger("pipeline")


def place(task: "StoredTask", action: Action, store: Store) -> ActionRecord:
    """Have the task's engine build it; returns the record that its machine left.

    Args:
        task: To be built.
        action: What it is.
        store: Of this machine; the other has the same one, or shares one with it.

    Raises:
        TaskFailure: It was not built, or cannot be found.
        LostInputError: The other machine found an input damaged, or found none.
        StoreError: The engine cannot be used.
    """
    engine, cost = executor_of(task), expected_cost(task, store)
    require_time_left(task, task.until, action.key, cost, store)
    screen.info("%s: sent out by %s", task.label, engine)
    for upstream in task.requires().values():
        if record := upstream.record():
            give(store, record)  # which was made while there was no shared store, say
    errand = Errand.of(task, action.key, cost.peak_memory_bytes if cost else 0)
    outcome = _sent(ENGINES[engine], errand, store)
    if record := _found(action, store, outcome):  # even if whoever built it was lost right after
        screen.info("%s: done on %s", task.label, outcome.host or record.provenance["host"])
        return record
    raise _failure(task, action, store, outcome)


def _sent(engine: Engine, errand: Errand, store: Store, most: int = _MOST_MACHINES) -> Outcome:
    """What became of an errand on the first machine whose disk has room, or on the last asked.

    Where all share one folder, which is full, one is enough.
    """
    errand = replace(errand, rather_not=_full(store))
    outcome = engine.run(errand)
    is_known = outcome.node in ("", *errand.rather_not)
    if outcome.kind != "disk" or is_known or not current_remote().url or most == 1:
        return outcome
    screen.info("%s on %s: sent on. %s", errand.task, outcome.host, outcome.message)
    (store.root / "quarantine" / f"{outcome.node}{_FULL}").touch()
    return _sent(engine, errand, store, most - 1)


def _full(store: Store) -> tuple[str, ...]:
    """The machines whose disks were full a short while ago, whoever met that."""
    since = time.time() - _SECONDS_FULL
    noted = sorted((store.root / "quarantine").glob(f"*{_FULL}"))
    return tuple(p.name.removesuffix(_FULL) for p in noted if p.stat().st_mtime > since)


def _found(action: Action, store: Store, outcome: Outcome) -> ActionRecord | None:
    """The record that a machine left; waited for while it cannot be seen yet.

    That is, while the shared store does not answer, or a shared folder may be remembered as it was.
    """
    begun = time.monotonic()
    while True:
        record = recorded(store, action.key)
        if record and is_available(store, record):
            return record
        is_away = current_remote().is_silent("reading")
        patience = _SECONDS_FOR_THE_STORE if is_away else _SECONDS_TO_APPEAR
        if outcome.kind != "built" or time.monotonic() > begun + patience:
            return None
        _look_anew(store.action(action.key))
        time.sleep(1)


def _look_anew(path: Path) -> None:
    """Open the folders above, for which NFS asks the server what is new in them."""
    for folder in (path.parent.parent, path.parent):
        with contextlib.suppress(OSError):
            os.listdir(folder)  # noqa: PTH208


def _failure(
    task: "StoredTask", action: Action, store: Store, outcome: Outcome
) -> TaskFailure | LostInputError:
    """What to tell the user, and a log of this store; or the input that the other machine lost."""
    for upstream in task.requires().values():
        if (outcome.kind, outcome.message) == ("lost", upstream.task_id):
            return LostInputError(upstream)
    where = f" (on {outcome.host})" if outcome.host else ""
    kind, reason = outcome.kind, f"{outcome.message.rstrip('.')}{where}."
    if kind == "built" or kind == "lost":
        reason = (
            f"{outcome.host} has built it, or its input, but not into the store that this machine"
            " shares, or that does not answer."
            " Name the same folder as STYLETRF_STORE, or the same STYLETRF_REMOTE, on all"
            " of them."
        )
        kind = "user"
    if kind != "late":
        store.new_log(task.task_family, action.key).write_text(f"{reason}\n")
    return TaskFailure(kind, str(task), reason)
