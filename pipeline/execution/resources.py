"""The resources that a build holds while it runs, and its expected cost."""

import contextlib
import logging
import math
import os
from functools import partial

from pipeline.artifact_task import ArtifactTask
from pipeline.execution.cost_history import Cost, cost_history, cost_of_similar
from pipeline.execution.cpu_memory import CpuAllocation, allocate, usable_cores
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


def cpu_for(label: str, cost: Cost | None) -> contextlib.AbstractContextManager[CpuAllocation]:
    """Leases cores for the build, and its expected memory.

    A command that runs one build at a time uses the whole host, unless STYLETRF_CORES sets the
    number of cores.
    """
    workers, cores = workers_of_command(), int(os.environ.get(CORES, "0"))
    if workers == 1 and not cores:
        return contextlib.nullcontext(CpuAllocation(len(usable_cores())))
    on_wait = partial(_log.info, "%s: waiting %s", label)
    part = math.ceil(len(usable_cores()) / workers)
    return allocate(cores or part, cost.peak_memory_bytes if cost else None, on_wait)


def expected_cost(task: ArtifactTask, store: Store) -> Cost | None:
    """Returns the expected cost of a build, if the store has the costs of similar ones."""
    return cost_of_similar(cost_history(store, task.task_family), significant(task))


def significant(task: ArtifactTask) -> dict[str, str]:
    """Returns the serialized parameters that distinguish the task from others."""
    serialized: dict[str, str] = task.to_str_params(only_significant=True)  # type: ignore[no-untyped-call]
    return serialized
