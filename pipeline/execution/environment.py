"""The environment of a build: its threads, how they wait, and how much freed memory it keeps.

Libraries read these variables when they are loaded, and the allocator when the process starts.
`env $(python -m pipeline.execution.environment) PROGRAM` starts a program with them.
"""

import os
from collections.abc import Mapping

from pipeline.code.interpreters import interpreter_environment
from pipeline.execution.cpu_memory import THREADS, has_core_quota, usable_cores

SPIN_COUNT = "GOMP_SPINCOUNT"
"""The variable for how often a thread of libgomp checks a barrier before it sleeps."""
_SPINS = "10000"
_KEPT_MEMORY = "MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"
"""The variables of glibc for how much freed memory the process keeps."""


def build_environment() -> dict[str, str]:
    """Returns the variables of an interpreter for builds."""
    return {**interpreter_environment(), **build_settings(os.environ), "PYTHONUNBUFFERED": "1"}


def build_settings(environment: Mapping[str, str]) -> dict[str, str]:
    """Returns the variables that builds add to those of the user."""
    return (
        openmp_wait_settings(environment)
        | quota_settings(environment)
        | allocator_settings(environment)
    )


def openmp_wait_settings(environment: Mapping[str, str]) -> dict[str, str]:
    """Returns the variables for how OpenMP threads wait; empty if the user has set them.

    By default, libgomp's threads spin in a barrier for so long that they can keep another thread,
    for which they wait, from its core (measured: a fit a hundred times slower). Builds also have
    fewer threads beside other work (decision 70).
    """
    is_set = SPIN_COUNT in environment or "OMP_WAIT_POLICY" in environment
    return {} if is_set else {SPIN_COUNT: _SPINS}


def quota_settings(environment: Mapping[str, str]) -> dict[str, str]:
    """Returns the variables for as many threads as a quota of the container has cores.

    Libraries know nothing of quotas, and start a thread for each core of the host. Without a quota,
    or if the user has set one of the variables, it returns none.
    """
    if not has_core_quota() or any(name in environment for name in THREADS):
        return {}
    return dict.fromkeys(THREADS, str(len(usable_cores())))


def allocator_settings(environment: Mapping[str, str]) -> dict[str, str]:
    """Returns variables by which a build keeps the memory it frees; empty if the user set them.

    By default, glibc returns large blocks at once, and every page of the next block costs a page
    fault (measured: a sixth of the time of a fit, and a tenth of that of a render).
    """
    is_set = any(name.startswith(("MALLOC_", "GLIBC_TUNABLES")) for name in environment)
    return {} if is_set else dict.fromkeys(_KEPT_MEMORY, str(2**30))


if __name__ == "__main__":
    for name, value in build_settings(os.environ).items():
        print(f"{name}={value}")  # noqa: T201
