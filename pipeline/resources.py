"""What a task's build holds while it runs, and what it is expected to take."""

import contextlib
import logging
from functools import partial
from typing import TYPE_CHECKING

from pipeline.costs import USUAL_SECONDS, Cost, expected, spendings
from pipeline.gpu import VISIBLE, Lease, leased
from pipeline.host import Share, shared, workers_of_command
from pipeline.settings import setting
from pipeline.store import Store

if TYPE_CHECKING:
    from pipeline.task import StoredTask

screen = logging.getLogger("pipeline")


def executor_of(task: "StoredTask") -> str:
    """Who runs the task's build, by its word."""
    return task.executor or setting("store", "executor")


def card_for(task: "StoredTask") -> contextlib.AbstractContextManager[Lease]:
    """A GPU for the build; where it wants none, it shall see none."""
    if not task.needs_gpu:
        return contextlib.nullcontext(({VISIBLE: ""}, ()))
    say_so = partial(screen.info, "%s: every GPU of this host is leased, waiting", task.label)
    return leased(say_so, task.most_cards)


def share_for(task: "StoredTask", store: Store) -> contextlib.AbstractContextManager[Share]:
    """Cores for the build, and the memory that like ones took."""
    say_so = partial(screen.info, "%s: waiting %s", task.label)
    cost = expected_cost(task, store)
    return shared(workers_of_command(), cost.peak_memory_bytes if cost else None, say_so)


def expected_cost(task: "StoredTask", store: Store) -> Cost | None:
    """What a build of the task will take, if the store tells of like ones."""
    return expected(spendings(store, task.task_family), significant(task))


def expected_seconds(task: "StoredTask", store: Store) -> float:
    """How long that will take, the usual time where nothing is known."""
    cost = expected_cost(task, store)
    return cost.seconds if cost else USUAL_SECONDS


def significant(task: "StoredTask") -> dict[str, str]:
    """The parameters that tell the task from others, serialised."""
    told: dict[str, str] = task.to_str_params(only_significant=True)  # type: ignore[no-untyped-call]
    return told
