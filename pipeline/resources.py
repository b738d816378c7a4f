"""What a task's build holds while it runs, and what it is expected to take."""

import contextlib
import logging
import math
import os
from functools import partial
from typing import TYPE_CHECKING

from pipeline.costs import Cost, expected, spendings
from pipeline.gpu import VISIBLE, Lease, leased
from pipeline.host import Share, shared, usable_cores, workers_of_command
from pipeline.settings import setting
from pipeline.store import Store

if TYPE_CHECKING:
    from pipeline.task import StoredTask

CORES = "STYLETRF_CORES"
"""How many cores each build of a command uses; a cluster sets it for its remote jobs."""
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


def share_for(task: "StoredTask", cost: Cost | None) -> contextlib.AbstractContextManager[Share]:
    """Cores for the build, and the memory that it is expected to take.

    A command that runs one build at a time has the host to itself, unless it was told how many
    cores to use.
    """
    workers, cores = workers_of_command(), int(os.environ.get(CORES, "0"))
    if workers == 1 and not cores:
        return contextlib.nullcontext(Share(len(usable_cores())))
    say_so = partial(screen.info, "%s: waiting %s", task.label)
    part = math.ceil(len(usable_cores()) / workers)
    return shared(cores or part, cost.peak_memory_bytes if cost else None, say_so)


def expected_cost(task: "StoredTask", store: Store) -> Cost | None:
    """What a build of the task will take, if the store tells of like ones."""
    return expected(spendings(store, task.task_family), significant(task))


def significant(task: "StoredTask") -> dict[str, str]:
    """The parameters that tell the task from others, serialised."""
    told: dict[str, str] = task.to_str_params(only_significant=True)  # type: ignore[no-untyped-call]
    return told
