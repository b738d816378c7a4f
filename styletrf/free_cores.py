"""The threads of a computation, of which there are as many as cores that other work leaves free.

The threads of a parallel loop wait for each other at its end. If other work keeps one of them from
its core, all wait for that one, hundreds of times an iteration. So beside other work a computation
does most with one thread for each core that is free (decision 70).
"""

import os
import sys
import time
from dataclasses import dataclass
from typing import final

import psutil

_LIBRARIES = "torch", "numba"


@dataclass(frozen=True, slots=True)
class CoreTimes:
    """Seconds since some moment in the past.

    Attributes:
        clock_s: Those of the clock.
        idle_s: Those that the cores of this process were idle, summed over the cores.
        own_s: Those that its threads computed, summed over the threads.
    """

    clock_s: float
    idle_s: float
    own_s: float

    def free_cores_since(self, before: "CoreTimes") -> float:
        """Returns how many cores were idle or this process's, on average since earlier times.

        Raises:
            ZeroDivisionError: The clock shows the same time.
        """
        free_s = self.idle_s - before.idle_s + self.own_s - before.own_s
        return free_s / (self.clock_s - before.clock_s)


def core_times() -> CoreTimes:
    """Returns the times until now of the cores that this process is bound to, or else of all."""
    times = psutil.cpu_times(percpu=True)
    bound = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else range(len(times))
    own = [times[core] for core in bound if core < len(times)]
    idle_s = sum(each.idle + getattr(each, "iowait", 0.0) for each in own)
    return CoreTimes(time.monotonic(), idle_s, time.process_time())


@final
class FreeCoreThreads:
    """Adjusts how many threads torch and numba use for loops that the calling thread begins.

    They stay as they are when the computation ends, and never are more than before the first
    adjustment.

    Args:
        period_s: The least time between two looks at the cores.
    """

    def __init__(self, period_s: float = 0.5) -> None:
        self._period_s = period_s
        self._most: dict[str, int] = {}
        self._before = core_times()

    def adjust(self) -> None:
        """Gives the libraries that are loaded a thread for each free core, and at least one."""
        if time.monotonic() - self._before.clock_s < self._period_s:
            return
        now = core_times()
        free = int(now.free_cores_since(self._before) + 0.5)
        self._before = now
        for name in _LIBRARIES:
            if library := sys.modules.get(name):
                most = self._most.setdefault(name, library.get_num_threads())
                library.set_num_threads(max(1, min(most, free)))
