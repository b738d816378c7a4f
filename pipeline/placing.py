"""A task built on another machine: sent by an engine, found in the store that both share."""

import logging
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.engines import ENGINES, Engine
from pipeline.errand import Errand, Outcome
from pipeline.errors import LostInputError, TaskFailure
from pipeline.record import Action, ActionRecord
from pipeline.resources import executor_of, expected_cost
from pipeline.settings import current_remote
from pipeline.sharing import is_available, recorded
from pipeline.store import Store
from pipeline.until import require_time

if TYPE_CHECKING:
    from pipeline.task import StoredTask

_SECONDS_FOR_THE_STORE = 600.0
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
    require_time(task, cost)
    screen.info("%s: sent out by %s", task.label, engine)
    errand = Errand.of(task, action.key, cost.peak_memory_bytes if cost else 0)
    with store.workspace(f"errand-{action.key}") as workspace:
        outcome = _sent(ENGINES[engine], errand, workspace)
    if record := _found(action, store, outcome):  # even if whoever built it was lost right after
        screen.info("%s: done on %s", task.label, outcome.host or record.provenance["host"])
        return record
    raise _failure(task, action, store, outcome)


def _sent(engine: Engine, errand: Errand, folder: Path) -> Outcome:
    """What became of an errand on the first machine whose disk has room for it."""
    outcome = engine.run(errand, folder)
    while outcome.kind == "disk" and outcome.node not in ("", *errand.rather_not):
        screen.info("%s on %s: sent on. %s", errand.task, outcome.host, outcome.message)
        errand = replace(errand, rather_not=(*errand.rather_not, outcome.node))
        outcome = engine.run(errand, folder)
    return outcome


def _found(action: Action, store: Store, outcome: Outcome) -> ActionRecord | None:
    """The record that a machine left; waited for while the shared store does not answer."""
    end = time.monotonic() + _SECONDS_FOR_THE_STORE
    while True:
        record = recorded(store, action.key)
        if record and is_available(store, record):
            return record
        is_away = current_remote().is_silent("reading") and time.monotonic() < end
        if outcome.kind != "built" or not is_away:
            return None
        time.sleep(1)


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
