"""The resources that a build holds while it runs, and its expected cost."""

import contextlib
import logging
import math
import os
from collections.abc import Iterator
from functools import partial

from pipeline.artifact_task import ArtifactTask
from pipeline.errors import StoreError
from pipeline.execution.cost_history import Cost, cost_history, cost_of_similar
from pipeline.execution.cpu_memory import (
    CpuAllocation,
    allocate,
    allocate_alone,
    usable_cores,
)
from pipeline.execution.gpu import VISIBLE, Lease, leased
from pipeline.parameters import workers_of_command
from pipeline.store import Store

CORES = "STYLETRF_CORES"
"""How many cores each build of a command uses; a cluster sets it for its remote jobs."""
_log = logging.getLogger("pipeline")


def lease_gpu(label: str, max_gpus: int) -> contextlib.AbstractContextManager[Lease]:
    """Leases GPUs for the build. A build without GPUs sees none."""
    if not max_gpus:
        return contextlib.nullcontext(({VISIBLE: ""}, ()))
    on_wait = partial(_log.info, "%s: waiting for a GPU, since all are leased", label)
    return leased(on_wait, max_gpus)


@contextlib.contextmanager
def cpu_for(label: str, cost: Cost | None) -> Iterator[CpuAllocation]:
    """Leases cores for the build, and its expected memory.

    A command that runs one build at a time has the whole host while no other build runs, and
    shares it with another command as two workers of one command do. STYLETRF_CORES sets the number
    of cores instead: the build waits for as many, or for all where the host has fewer.
    """
    workers, cores = workers_of_command(), _cores_of_user()
    is_lone, host = workers == 1 and not cores, len(usable_cores())
    part = cores or math.ceil(host / max(2, workers))
    expected_bytes = cost.peak_memory_bytes if cost else None
    on_wait = partial(_log.info, "%s: waiting %s", label)
    allocated = allocate_alone if is_lone else partial(allocate, min_cores=max(1, cores))
    with allocated(part, expected_bytes, on_wait) as allocation:
        if is_lone and allocation.cores < host:
            _log.info(
                "%s: uses %d of %d cores, beside another build", label, allocation.cores, host
            )
        yield allocation


def _cores_of_user() -> int:
    """Returns the number of cores that the user sets; 0 without."""
    given = os.environ.get(CORES) or "0"
    if not given.isdecimal():
        raise StoreError(f"{CORES} = {given} is not a whole number. Correct it, or unset it.")
    return int(given)


def expected_cost(task: ArtifactTask, store: Store) -> Cost | None:
    """Returns the expected cost of a build, if the store has the costs of similar ones."""
    return cost_of_similar(cost_history(store, task.task_family), significant(task))


def significant(task: ArtifactTask) -> dict[str, str]:
    """Returns the serialized parameters that distinguish the task from others."""
    serialized: dict[str, str] = task.to_str_params(only_significant=True)  # type: ignore[no-untyped-call]
    return serialized
