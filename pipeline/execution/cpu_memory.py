"""The cores and the memory of a build, where a command runs several at once.

An allocation is a set of locks (`pipeline.execution.host_locks`): cores by their numbers, and 64ths
of the memory. A build is bound to its cores, so that its threads, which may spin, cost no other
build anything.
"""

import contextlib
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

from pipeline.execution.host_locks import acquire, fifo_queue, open_locks
from pipeline.settings import setting

_MEMORY_PARTS = 64
_CGROUP = Path("/sys/fs/cgroup")
SPIN_COUNT = "GOMP_SPINCOUNT"
"""The variable for how often a thread of libgomp looks at a barrier before it sleeps."""
_SPINS = "2000"
_KEPT_MEMORY = "MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"
"""The variables of glibc for how much free memory is kept."""
THREADS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENCV_FOR_THREADS_NUM", "MKL_NUM_THREADS")
"""What tells libraries how many threads to start."""


@dataclass(frozen=True, slots=True)
class CpuAllocation:
    """What a build may use.

    Attributes:
        cores: How many it shall use.
        cpu_affinity: The numbers of the cores it is bound to; none: it may run on all.
        environment: What tells its libraries so.
        inherited_fds: The files whose flocks hold the share.
    """

    cores: int
    cpu_affinity: tuple[int, ...] = ()
    environment: tuple[tuple[str, str], ...] = ()
    inherited_fds: tuple[int, ...] = ()


@contextlib.contextmanager
def allocate(
    max_cores: int, expected_bytes: int | None, say_so: Callable[[str], object]
) -> Iterator[CpuAllocation]:
    """Hold a share of this host: cores, and the memory that is expected.

    It waits for one core and for the memory, in the order of asking.

    Args:
        max_cores: How many to take where so many are free.
        expected_bytes: The memory that the build will take; a part like that of the cores where it
            is unknown.
        say_so: Told what is waited for, where it is.

    Raises:
        StoreError: When the folder of leases cannot be used.
    """
    cores, memory = usable_cores(), memory_bytes()
    part = memory / _MEMORY_PARTS
    wanted = memory * max_cores / _cores_of_memory() if expected_bytes is None else expected_bytes
    n_parts = min(_MEMORY_PARTS, max(1, math.ceil(wanted / part)))
    with (
        open_locks("memory", [str(n) for n in range(_MEMORY_PARTS)]) as parts,
        open_locks("core", [str(n) for n in cores]) as files,
    ):
        with fifo_queue(lambda: say_so("for its turn")):
            resource = f"for {n_parts * part / 2**30:.1f} GiB of memory"
            held = acquire(parts, n_parts, n_parts, lambda: say_so(resource))
            mine = acquire(files, 1, max_cores, lambda: say_so("for a core"))
        yield CpuAllocation(
            cores=len(mine),
            cpu_affinity=tuple(map(int, mine)) if _may_bind() else (),
            environment=tuple((name, str(len(mine))) for name in THREADS),
            inherited_fds=(*(parts[name] for name in held), *(files[name] for name in mine)),
        )


def usable_cores() -> list[int]:
    """The cores this process may use: those it is bound to, or as many as its group's quota pays.

    Under a quota the numbers stand for no cores in particular.
    """
    return _bound()[: _quota() or None]


def memory_bytes() -> int:
    """What builds may take together: `[host] memory_gib`, or nine tenths of what the host has."""
    if gibibytes := float(setting("host", "memory_gib")):
        return int(gibibytes * 2**30)
    total = int(psutil.virtual_memory().total)
    return int(0.9 * min([total, *_limits_of_memory()]))


def available_memory_bytes() -> int:
    """Returns what a build may take now: what the host, or this container's group, has left.

    A group's use counts files that lie in memory; those that gave way to nothing yet
    (`inactive_file`) do so for a build.
    """
    left = int(psutil.virtual_memory().available)
    if not (limits := _limits_of_memory()):
        return left
    used = [*_words("memory.current"), *_words("memory/memory.usage_in_bytes"), "0"][0]
    words = [*_words("memory.stat"), *_words("memory/memory.stat")]
    files = dict(zip(words[::2], words[1::2], strict=False)).get("inactive_file", "0")
    return max(0, min(left, min(limits) - int(used) + int(files)))


def _limits_of_memory() -> list[int]:
    """Of this container's control group, where they are lower than what the host has."""
    words = [*_words("memory.max"), *_words("memory/memory.limit_in_bytes")]
    limits = [int(word) for word in words if word.isdigit()]
    return [limit for limit in limits if limit < psutil.virtual_memory().total]


def _cores_of_memory() -> int:
    """How many cores share what `memory_bytes` tells: a process that is bound shares it, too."""
    is_own = float(setting("host", "memory_gib")) or _quota() or _limits_of_memory()
    return len(usable_cores()) if is_own else max(len(usable_cores()), os.cpu_count() or 1)


def _bound() -> list[int]:
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def _may_bind() -> bool:
    """Not under a quota, where others are likely to bind to the same cores; and on Linux alone."""
    return hasattr(os, "sched_setaffinity") and len(usable_cores()) == len(_bound())


def _quota() -> int:
    """How many cores the control group of this container may keep busy; 0 if no file says so."""
    quota = _words("cpu.max") or [*_words("cpu/cpu.cfs_quota_us"), *_words("cpu/cpu.cfs_period_us")]
    if len(quota) != 2 or not quota[0].isdigit():
        return 0
    return max(1, math.ceil(int(quota[0]) / int(quota[1])))


def _words(name: str) -> Sequence[str]:
    """What the control group says; nothing where there is none."""
    with contextlib.suppress(OSError):
        return (_CGROUP / name).read_text().split()
    return []


def openmp_wait_settings(environment: Mapping[str, str]) -> dict[str, str]:
    """Returns how a build's OpenMP threads wait for each other; nothing where the user set it.

    By default libgomp's threads spin so long in a barrier that, beside any other busy thread, they
    keep the one they wait for from its core (measured: a fit a hundred times slower).
    """
    is_set = SPIN_COUNT in environment or "OMP_WAIT_POLICY" in environment
    return {} if is_set else {SPIN_COUNT: _SPINS}


def allocator_settings(environment: Mapping[str, str]) -> dict[str, str]:
    """Returns variables by which a build keeps the memory it frees; none where the user set them.

    By default glibc gives large blocks back at once, and every page of the next one costs a fault
    (measured: a sixth of a fit, and a tenth of a render).
    """
    is_set = any(name.startswith(("MALLOC_", "GLIBC_TUNABLES")) for name in environment)
    return {} if is_set else dict.fromkeys(_KEPT_MEMORY, str(2**30))
