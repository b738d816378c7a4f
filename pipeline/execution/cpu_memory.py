"""The cores and the memory of a build, if a command runs several at once.

An allocation is a set of locks (`pipeline.execution.host_locks`): cores by their numbers, and 64ths
of the memory. A build is bound to its cores, so that its threads, which may spin, do not slow down
other builds.
"""

import contextlib
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

from pipeline.execution.host_locks import acquire, fifo_queue, open_locks
from pipeline.settings import number_setting

_MEMORY_PARTS = 64
_CGROUP = Path("/sys/fs/cgroup")
SPIN_COUNT = "GOMP_SPINCOUNT"
"""The variable for how often a thread of libgomp checks a barrier before it sleeps."""
_SPINS = "1000"
_KEPT_MEMORY = "MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"
"""The variables of glibc for how much freed memory the process keeps."""
THREADS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENCV_FOR_THREADS_NUM", "MKL_NUM_THREADS")
"""The variables for how many threads libraries start."""


@dataclass(frozen=True, slots=True)
class CpuAllocation:
    """The cores and memory of a build.

    Attributes:
        cores: How many cores it uses.
        cpu_affinity: The numbers of the cores it is bound to; empty for all.
        environment: The variables that set the threads of its libraries.
        inherited_fds: The files whose flocks are its leases.
    """

    cores: int
    cpu_affinity: tuple[int, ...] = ()
    environment: tuple[tuple[str, str], ...] = ()
    inherited_fds: tuple[int, ...] = ()


@contextlib.contextmanager
def allocate(
    max_cores: int, expected_bytes: int | None, on_wait: Callable[[str], object]
) -> Iterator[CpuAllocation]:
    """Holds a share of this host: cores, and the expected memory.

    It waits for one core and for the memory, in the order of the requests.

    Args:
        max_cores: How many cores to take, if enough are free.
        expected_bytes: The memory of the build. If it is unknown, the build gets the same share
            of memory as of cores.
        on_wait: Called with the resource that the build waits for, if it waits.

    Raises:
        StoreError: The folder of leases cannot be used.
    """
    cores, memory = usable_cores(), memory_bytes()
    part = memory / _MEMORY_PARTS
    wanted = memory * max_cores / _cores_of_memory() if expected_bytes is None else expected_bytes
    n_parts = min(_MEMORY_PARTS, max(1, math.ceil(wanted / part)))
    with (
        open_locks("memory", [str(n) for n in range(_MEMORY_PARTS)]) as parts,
        open_locks("core", [str(n) for n in cores]) as files,
    ):
        with fifo_queue(lambda: on_wait("for its turn")):
            resource = f"for {n_parts * part / 2**30:.1f} GiB of memory"
            held = acquire(parts, n_parts, n_parts, lambda: on_wait(resource))
            mine = acquire(files, 1, max_cores, lambda: on_wait("for a core"))
        yield CpuAllocation(
            cores=len(mine),
            cpu_affinity=tuple(map(int, mine)) if _may_bind() else (),
            environment=tuple((name, str(len(mine))) for name in THREADS),
            inherited_fds=(*(parts[name] for name in held), *(files[name] for name in mine)),
        )


def usable_cores() -> list[int]:
    """Returns the cores this process may use: those it is bound to, up to its group's quota.

    Under a quota, the numbers are not those of particular cores.
    """
    return _bound()[: _quota() or None]


def memory_bytes() -> int:
    """Returns the memory for all builds: `[host] memory_gib`, or nine tenths of the host's."""
    if gibibytes := number_setting("host", "memory_gib"):
        return int(gibibytes * 2**30)
    total = int(psutil.virtual_memory().total)
    return int(0.9 * min([total, *_limits_of_memory()]))


def available_memory_bytes() -> int:
    """Returns the memory that is free for a build, of the host or of this control group.

    The use of a group includes cached files. The kernel drops the inactive ones (`inactive_file`)
    for a build.
    """
    left = int(psutil.virtual_memory().available)
    if not (limits := _limits_of_memory()):
        return left
    used = [*_words("memory.current"), *_words("memory/memory.usage_in_bytes"), "0"][0]
    words = [*_words("memory.stat"), *_words("memory/memory.stat")]
    files = dict(zip(words[::2], words[1::2], strict=False)).get("inactive_file", "0")
    return max(0, min(left, min(limits) - int(used) + int(files)))


def _limits_of_memory() -> list[int]:
    """Returns the memory limits of this control group that are below the host's memory."""
    words = [*_words("memory.max"), *_words("memory/memory.limit_in_bytes")]
    limits = [int(word) for word in words if word.isdigit()]
    return [limit for limit in limits if limit < psutil.virtual_memory().total]


def _cores_of_memory() -> int:
    """Returns how many cores share `memory_bytes`: all of the host without limits of this group."""
    is_own = number_setting("host", "memory_gib") or _quota() or _limits_of_memory()
    return len(usable_cores()) if is_own else max(len(usable_cores()), os.cpu_count() or 1)


def _bound() -> list[int]:
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def _may_bind() -> bool:
    """Whether builds may be bound: on Linux, and not under a quota, where cores have no numbers."""
    return hasattr(os, "sched_setaffinity") and len(usable_cores()) == len(_bound())


def _quota() -> int:
    """Returns how many cores the control group of this container may use; 0 without a quota."""
    quota = _words("cpu.max") or [*_words("cpu/cpu.cfs_quota_us"), *_words("cpu/cpu.cfs_period_us")]
    if len(quota) != 2 or not quota[0].isdigit():
        return 0
    return max(1, math.ceil(int(quota[0]) / int(quota[1])))


def _words(name: str) -> Sequence[str]:
    """Returns the words in a file of the control group; empty without such a file."""
    with contextlib.suppress(OSError):
        return (_CGROUP / name).read_text().split()
    return []


def openmp_wait_settings(environment: Mapping[str, str]) -> dict[str, str]:
    """Returns the variables for how OpenMP threads wait; empty if the user has set them.

    By default, libgomp's threads spin in a barrier for so long that they can keep another thread,
    for which they wait, from its core (measured: a fit a hundred times slower).
    """
    is_set = SPIN_COUNT in environment or "OMP_WAIT_POLICY" in environment
    return {} if is_set else {SPIN_COUNT: _SPINS}


def allocator_settings(environment: Mapping[str, str]) -> dict[str, str]:
    """Returns variables by which a build keeps the memory it frees; empty if the user set them.

    By default, glibc returns large blocks at once, and every page of the next block costs a page
    fault (measured: a sixth of the time of a fit, and a tenth of that of a render).
    """
    is_set = any(name.startswith(("MALLOC_", "GLIBC_TUNABLES")) for name in environment)
    return {} if is_set else dict.fromkeys(_KEPT_MEMORY, str(2**30))
