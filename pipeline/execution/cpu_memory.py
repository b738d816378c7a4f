"""The cores and the memory of a build, beside other builds of this command and of others.

An allocation is a set of locks (`pipeline.execution.host_locks`): cores by their numbers, and 64ths
of the memory. A build is bound to its cores, so that its threads, which may spin, do not slow down
other builds. A build that is alone on the host may use all cores, and locks a part of them.
"""

import contextlib
import logging
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

from pipeline.errors import StoreError
from pipeline.execution.host_locks import acquire, fifo_queue, open_locks, release, try_acquire
from pipeline.settings import number_setting

_MEMORY_PARTS = 64
_log = logging.getLogger(__name__)
_CGROUP = Path("/sys/fs/cgroup")
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
    max_cores: int,
    expected_bytes: int | None,
    on_wait: Callable[[str], object],
    min_cores: int = 1,
) -> Iterator[CpuAllocation]:
    """Holds a part of this host: cores, and the expected memory.

    It waits for `min_cores` and for the memory, in the order of the requests: while it waits, all
    builds behind it wait, too, so that builds that need less do not keep it waiting for ever.

    Args:
        max_cores: How many cores to take, if enough are free.
        expected_bytes: The memory of the build. If it is unknown, the build gets the same
            fraction of the memory as of the cores.
        on_wait: Called with the resource that the build waits for, if it waits.
        min_cores: How many cores the build needs. If the host has fewer, it gets all of them.

    Raises:
        StoreError: The folder of leases cannot be used.
    """
    n_parts = _memory_parts(max_cores, expected_bytes)
    with _units() as (parts, cores):
        least = min(min_cores, len(cores))
        needed = "for a core" if least == 1 else f"for {least} cores"
        with fifo_queue(lambda: on_wait("for its turn")):
            held = _acquire_memory(parts, n_parts, on_wait)
            mine = acquire(cores, least, max_cores, lambda: on_wait(needed))
        yield _bound_to(mine, (*(parts[name] for name in held), *(cores[name] for name in mine)))


@contextlib.contextmanager
def allocate_alone(
    max_cores: int, expected_bytes: int | None, on_wait: Callable[[str], object]
) -> Iterator[CpuAllocation]:
    """Holds a part of this host for a command that runs one build at a time.

    While no other build holds a core, the build uses all, and leases `max_cores`, so that the next
    one finds the others free. Beside other builds it is bound to as many of the free ones. It waits
    for its turn, behind builds that wait for cores or memory, and for the memory it expects. If
    that is unknown, it leases the same fraction of the memory as of the cores, as far as this is
    free. In its turn it waits for no core: if none is free, or a quota says how many it may use, it
    uses all. Where the folder of leases cannot be used, it shares nothing, and a warning says so.
    The arguments are those of `allocate`.
    """
    n_parts = _memory_parts(max_cores, expected_bytes)
    with contextlib.ExitStack() as stack:
        try:
            parts, cores = stack.enter_context(_units())
        except StoreError as error:
            _log.warning("%s. This command shares the host with no other", error)
            yield CpuAllocation(len(usable_cores()))
            return
        with fifo_queue(lambda: on_wait("for its turn")):
            if expected_bytes is None:
                held = try_acquire(parts, 0, n_parts)
            else:
                held = _acquire_memory(parts, n_parts, on_wait)
            free = try_acquire(cores, 0, len(cores))
            mine = free[:max_cores]
            release(cores, free[max_cores:])
        fds = (*(parts[name] for name in held), *(cores[name] for name in mine))
        uses_all = len(free) in (0, len(cores)) or not _may_bind()
        yield CpuAllocation(len(cores), inherited_fds=fds) if uses_all else _bound_to(mine, fds)


@contextlib.contextmanager
def _units() -> Iterator[tuple[dict[str, int], dict[str, int]]]:
    """Opens the files of the parts of the memory and of the cores."""
    with (
        open_locks("memory", [str(n) for n in range(_MEMORY_PARTS)]) as parts,
        open_locks("core", [str(n) for n in usable_cores()]) as cores,
    ):
        yield parts, cores


def _memory_parts(max_cores: int, expected_bytes: int | None) -> int:
    """Returns how many parts of the memory a build takes: all if it expects more."""
    if expected_bytes is None:
        fraction = max_cores / _cores_of_memory()
    else:
        fraction = expected_bytes / memory_bytes()
    return min(_MEMORY_PARTS, max(1, math.ceil(_MEMORY_PARTS * fraction)))


def _acquire_memory(
    parts: Mapping[str, int], n_parts: int, on_wait: Callable[[str], object]
) -> list[str]:
    resource = f"for {n_parts * memory_bytes() / _MEMORY_PARTS / 2**30:.1f} GiB of memory"
    return acquire(parts, n_parts, n_parts, lambda: on_wait(resource))


def _bound_to(cores: Sequence[str], fds: tuple[int, ...]) -> CpuAllocation:
    return CpuAllocation(
        cores=len(cores),
        cpu_affinity=tuple(map(int, cores)) if _may_bind() else (),
        environment=tuple((name, str(len(cores))) for name in THREADS),
        inherited_fds=fds,
    )


def usable_cores() -> list[int]:
    """Returns the cores this process may use: those it is bound to, up to its group's quota.

    Under a quota, the numbers are not those of particular cores.
    """
    return _bound()[: _quota() or None]


def has_core_quota() -> bool:
    """Returns whether the control group of this container may use fewer cores than there are."""
    return len(usable_cores()) < len(_bound())


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
    return hasattr(os, "sched_setaffinity") and not has_core_quota()


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
