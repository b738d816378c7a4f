"""A task built on another machine: sent by an engine, found in the store that both share."""

import logging
from typing import TYPE_CHECKING

from pipeline.engines import ENGINES
from pipeline.errand import Errand
from pipeline.errors import TaskFailure
from pipeline.record import Action, ActionRecord
from pipeline.resources import executor_of, expected_cost
from pipeline.sharing import is_available, recorded
from pipeline.store import Store
from pipeline.until import require_time

if TYPE_CHECKING:
    from pipeline.task import StoredTask

screen = logging.getLogger("pipeline")


def place(task: "StoredTask", action: Action, store: Store) -> ActionRecord:
    """Have the task's engine build it; returns the record that its machine left.

    Args:
        task: To be built.
        action: What it is.
        store: Of this machine; the other has the same one, or shares one with it.

    Raises:
        TaskFailure: It was not built, or cannot be found.
        StoreError: The engine cannot be used.
    """
    engine, cost = executor_of(task), expected_cost(task, store)
    require_time(task, cost)
    screen.info("%s: sent out by %s", task.label, engine)
    errand = Errand.of(task, action.key, cost.peak_memory_bytes if cost else 0)
    with store.workspace(action.key) as workspace:
        outcome = ENGINES[engine].run(errand, workspace)
    if outcome.kind != "built":
        where = f" (on {outcome.host})" if outcome.host else ""
        raise TaskFailure(outcome.kind, str(task), f"{outcome.message.rstrip('.')}{where}.")
    record = recorded(store, action.key)
    if record is None or not is_available(store, record):
        raise TaskFailure(
            "user",
            str(task),
            f"{outcome.host} has built it, but not into the store that this machine shares."
            " Name the same folder as STYLETRF_STORE, or the same STYLETRF_REMOTE, on all of them.",
        )
    screen.info("%s: done on %s", task.label, outcome.host)
    return record
